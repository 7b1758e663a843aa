"""A finding: what a check saw, against which limit, and what to do."""

from typing import Literal, NamedTuple

Severity = Literal["error", "warning", "info"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "info")


class Finding(NamedTuple):
    """One finding of `lidarplan check`."""

    severity: Severity
    code: str  # listed in docs/findings.md
    subject: str  # what it is about: a scan, a pair, a lidar
    value: float | None
    unit: str
    limit: float | None
    text: str  # value and limit in words, and what to do


def by_severity(findings: list[Finding]) -> list[Finding]:
    """Errors first, then warnings, then information; otherwise in the order they were found.

    Examples
    --------
    >>> late = Finding("error", "range-max", "stare", 7000.0, "m", 6000.0, "too far")
    >>> early = Finding("info", "gate-offset", "stare", 9.0, "m", 12.5, "off")
    >>> [finding.code for finding in by_severity([early, late])]
    ['range-max', 'gate-offset']
    """
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))


def told_once(findings: list[Finding]) -> list[Finding]:
    """What people read: findings of one code in the same words become one, with all their subjects.

    Examples
    --------
    >>> fast = Finding("warning", "radial-speed", "stare K", 31.9, "m/s", 30.0, "over the limit")
    >>> [finding.subject for finding in told_once([fast, fast._replace(subject="stare W")])]
    ['stare K, stare W']
    """
    same: dict[tuple[str, str, str], list[Finding]] = {}
    for finding in findings:
        same.setdefault((finding.severity, finding.code, finding.text), []).append(finding)
    return [
        group[0]._replace(subject=", ".join(dict.fromkeys(finding.subject for finding in group)))
        for group in same.values()
    ]
