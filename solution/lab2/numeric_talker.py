"""A node that publishes a greeting on /chatter and a number on /numeric_chatter."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Int8, String


class NumericTalker(Node):
    """Publishes 'Hello World, n' on /chatter and 0, 1, …, 127, 0, … on /numeric_chatter."""

    LARGEST_NUMBER = 127

    def __init__(self):
        super().__init__('numeric_talker')
        self.string_publisher = self.create_publisher(String, 'chatter', 10)
        self.number_publisher = self.create_publisher(Int8, 'numeric_chatter', 10)
        self.counter = 0

        period_in_seconds = 0.5
        self.timer = self.create_timer(period_in_seconds, self.timer_callback)

    def timer_callback(self):
        message = String()
        message.data = f'Hello World, {self.counter}'
        self.string_publisher.publish(message)
        self.get_logger().info(f'Publishing: {message.data}')

        number = Int8()
        number.data = self.counter
        self.number_publisher.publish(number)
        self.get_logger().info(f'Publishing: {number.data}')

        if self.counter == self.LARGEST_NUMBER:
            self.counter = 0
        else:
            self.counter += 1


def main(args=None):
    rclpy.init(args=args)
    numeric_talker = NumericTalker()
    try:
        rclpy.spin(numeric_talker)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        numeric_talker.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
