"""A whole inbox: what it holds, a pool that grades it, what can be interrupted and goes on, and the summary.

    inbox → intake (here, several at once) → task as bytes → worker (here or elsewhere) → result as bytes → results/

A module here imports only from those above it: `records`, `inbox` (with `minerva`, `moodle`, `roster`), `work`,
`results`, `summary`, `pool`, `cluster`, `run`.
"""

from __future__ import annotations
