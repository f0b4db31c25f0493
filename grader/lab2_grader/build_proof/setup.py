"""Builds wherever colcon works; see `lab2_grader.build`."""

from setuptools import setup

setup(name="build_proof", version="0.0.0", packages=[], data_files=[("share/build_proof", ["package.xml"])])
