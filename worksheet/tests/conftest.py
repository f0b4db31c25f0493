"""Shared by the tests: the editions, rendered once."""

from __future__ import annotations

import pytest

from lab2_worksheet.pages import Editions, editions


@pytest.fixture(scope="session")
def made() -> Editions:
    return editions()
