"""A package above the library: floats that drift, with a model, a method, a sensor and a log format."""
