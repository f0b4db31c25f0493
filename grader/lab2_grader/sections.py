"""The addresses of the worksheet's sections and troubleshooting rows: the one place where ids become anchors."""

from __future__ import annotations


def section_anchor(section: str) -> str:
    """The anchor of a section, without `#`: `6.7.1` → `section-6-7-1`."""
    return "section-" + section.replace(".", "-")


def symptom_anchor(symptom: str) -> str:
    """The anchor of a row of the troubleshooting table, without `#`: `package-not-found` → `symptom-package-not-found`."""
    return "symptom-" + symptom


def section_link(worksheet_url: str, section: str) -> str:
    """The address of a section of the published worksheet; empty when *worksheet_url* is (it is not published)."""
    return f"{worksheet_url}#{section_anchor(section)}" if worksheet_url and section else ""


def symptom_link(worksheet_url: str, symptom: str) -> str:
    """The address of a troubleshooting row of the published worksheet; empty when *worksheet_url* is."""
    return f"{worksheet_url}#{symptom_anchor(symptom)}" if worksheet_url and symptom else ""
