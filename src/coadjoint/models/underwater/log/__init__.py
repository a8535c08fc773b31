"""Logs of vehicles: a run in the words of engineers, and tables of it as CSV."""
