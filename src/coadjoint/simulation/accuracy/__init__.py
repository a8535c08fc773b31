"""How accurate a run is: the local error at a sample of its steps, and whether the steps resolve the motion."""
