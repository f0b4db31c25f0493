"""A whole inbox: what it holds, a pool that grades it, what can be interrupted and goes on, and the summary.

    inbox → intake (here, several at once) → task as bytes → worker (here or elsewhere) → result as bytes → results/

A module here imports only from those named before it: `records`, `minerva`, `moodle`, `roster`, `inbox`, `work`, `results`,
`summary`, `gradebook`, `pool`, `cluster`, `progress`, `run`, `remark`.
"""

from __future__ import annotations
