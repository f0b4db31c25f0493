"""`python -m lab2_grader` is `lab2-grader`."""

import sys

from lab2_grader.cli import main

sys.exit(main())
