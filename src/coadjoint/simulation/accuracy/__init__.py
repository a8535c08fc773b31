"""The accuracy of a run: the local error at a sample of its steps, and whether the steps resolve the motion."""
