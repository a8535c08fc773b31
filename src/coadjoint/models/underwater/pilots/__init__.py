"""Pilots: what sees a craft, at its sample times, and says what its actuators shall do."""
