"""Scalar expressions: built shared and simplified, differentiated, and small linear systems of them solved."""
