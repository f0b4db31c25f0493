"""Builds the worksheet of lab 2: student and staff edition, a fragment, and the README of the template."""
