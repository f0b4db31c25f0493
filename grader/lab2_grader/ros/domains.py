"""Reserves a ROS domain, for worlds that share this machine's network because there is no isolation."""

from __future__ import annotations

import secrets
import socket

from lab2_grader.errors import FaultError

SAFE = range(102)  # their ports lie below the ephemeral ones of Linux (ROS 2 documentation, "The ROS_DOMAIN_ID")
DOMAINS = SAFE[1:]  # 0 is left to everybody who has set none


class Domain:
    """A domain that no other grader on this machine uses, until `close`.

    It is held by a socket with an abstract name (unix(7)): only one process can have it, and nothing of it is left when
    that process ends, however it ends.

    Raises:
        FaultError: All are taken.
    """

    def __init__(self) -> None:
        for number in secrets.SystemRandom().sample(DOMAINS, len(DOMAINS)):
            holder = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            try:
                holder.bind(f"\0lab2-grader-domain-{number}")
            except OSError:
                holder.close()
                continue
            self.number = number
            self._holder = holder
            return
        raise FaultError("Every ROS domain on this machine is in use by another grader.", "scenes")

    def environment(self) -> tuple[tuple[str, str], ...]:
        """What puts a process into this domain, and keeps it on this machine."""
        return (("ROS_DOMAIN_ID", str(self.number)), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"))

    def close(self) -> None:
        """Give the domain back; doing so twice does no harm."""
        self._holder.close()
