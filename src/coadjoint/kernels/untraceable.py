"""Why a function cannot become native code."""

from __future__ import annotations


class Untraceable(Exception):
    """A function uses something outside the tracer's language; `primitive` names it."""

    quiet = False
    """Whether the program was made for XLA, so that no message is needed when XLA takes over."""

    def __init__(self, primitive: str, reason: str = "") -> None:
        self.primitive = primitive
        super().__init__(f"The primitive `{primitive}` cannot be traced{': ' + reason if reason else ''}.")


class TooLarge(Untraceable):
    """A program is too long to be worth compiling."""

    def __init__(self, operations: int) -> None:
        self.primitive = "the complete step"
        Exception.__init__(
            self, f"The step comes to more than {operations:,} scalar operations, and may take minutes to compile."
        )


class Structured(Untraceable):
    """The equations of a stage have a structure that XLA uses; native code would treat them as dense."""

    quiet = True

    def __init__(self) -> None:
        self.primitive = "the complete step"
        Exception.__init__(self, "The step solves its equations by their structure, which native code does not know.")


class NotLinked(Untraceable):
    """The equations of a stage are not those of links and their neighbours, over which native code could loop."""

    quiet = True

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__("the step of a link", reason)


class UnknownVersion(Untraceable):
    """This version of JAX writes a primitive in a form that the tracer does not know."""
