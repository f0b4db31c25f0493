"""The launcher's own code; what launch files import as `launch` and `launch_ros` is offered from here by `api`."""
