"""A node that prints every greeting it hears on the topic /chatter."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import String


class Listener(Node):
    """Logs each String that arrives on /chatter."""

    def __init__(self):
        super().__init__('listener')
        self.string_subscription = self.create_subscription(
            String, 'chatter', self.string_callback, 10)

    def string_callback(self, message):
        self.get_logger().info(f'I heard: {message.data}')


def main(args=None):
    rclpy.init(args=args)
    listener = Listener()
    try:
        rclpy.spin(listener)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        listener.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
