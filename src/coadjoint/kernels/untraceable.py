"""Why a function cannot become native code."""

from __future__ import annotations


class Untraceable(Exception):
    """A function uses something outside the tracer's language; `primitive` names it."""

    quiet = False
    """Whether XLA is what the program was made for, so that nothing has to be said where it takes over."""

    def __init__(self, primitive: str, reason: str = "") -> None:
        self.primitive = primitive
        super().__init__(f"The primitive `{primitive}` cannot be traced{': ' + reason if reason else ''}.")


class TooLarge(Untraceable):
    """A program is longer than is worth compiling."""

    def __init__(self, operations: int) -> None:
        self.primitive = "the whole step"
        Exception.__init__(self, f"The step comes to more than {operations:,} scalar operations.")


class Structured(Untraceable):
    """The equations of a stage have a structure that XLA solves them by; native code would take them as dense."""

    quiet = True

    def __init__(self) -> None:
        self.primitive = "the whole step"
        Exception.__init__(self, "The step solves its equations by their structure, which native code does not know.")


class UnknownVersion(Untraceable):
    """This version of JAX writes a primitive in another way than those that the tracer was made for."""
