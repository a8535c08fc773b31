"""Speed and accuracy beside other programs: `python -m benchmarks` from the root of the repository.

Needs the extra `benchmarks`; a program that is not installed is reported, not missed.
"""
