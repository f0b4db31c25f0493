"""The only code that imports rclpy: a process of its own that plays one scene and records what it observes."""
