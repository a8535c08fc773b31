"""From a JAX function to scalar expressions, or to numbers."""
