"""Grades lab 2 by running it: builds a submission, launches it, listens, and judges what it did."""

__version__ = "1.0.0"
