"""Launch files as students write them, with what must come of them: for our launcher, and for the real one beside it."""

from __future__ import annotations

from dataclasses import dataclass

HEADER = """\
import os, signal, sys
from launch import LaunchDescription
from launch.actions import *
from launch.conditions import *
from launch.event_handlers import *
from launch.events.process import ShutdownProcess, SignalProcess
from launch.events import matches_action
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import *
from launch_ros.actions import (Node, PushRosNamespace, PushROSNamespace, SetParameter, SetParametersFromFile,
                                SetRemap, SetROSLogDir)
from launch_ros.parameter_descriptions import Parameter, ParameterFile, ParameterValue
from launch_ros.substitutions import ExecutableInPackage, FindPackagePrefix, FindPackageShare

HERE = os.path.dirname(os.path.abspath(__file__))

def talker(**more):
    return Node(package='lab2', executable='numeric_talker', **more)

def say(*text, **more):
    return ExecuteProcess(cmd=['echo', *text], **more)

def generate_launch_description():
    return LaunchDescription([
"""


@dataclass(frozen=True)
class Case:
    """A launch file.

    Args:
        name: Short and unique.
        entities: What stands in the LaunchDescription, or the whole file when `whole` is set.
        expect: Parts of lines that must be printed.
        code: Exit code.
        arguments: Launch arguments.
        absent: Parts of lines that must not be printed.
        whole: `entities` is the whole file.
        compare: The real launcher does the very same; else the reason why not.
    """

    name: str
    entities: str
    expect: tuple[str, ...]
    code: int = 0
    arguments: tuple[str, ...] = ()
    absent: tuple[str, ...] = ()
    whole: bool = False
    compare: str = ""

    @property
    def text(self) -> str:
        """The launch file."""
        return self.entities if self.whole else f"{HEADER}{self.entities}\n    ])\n"


CAUGHT = "[ERROR] [launch]: Caught exception in launch (see debug for traceback): "
STARTED = "[INFO] [numeric_talker-1]: process started with pid ["
CLEAN = "[INFO] [numeric_talker-1]: process has finished cleanly [pid "

CASES = (
    # --- Node ---
    Case(
        "the-template",
        """\
import launch
import launch.actions
import launch.substitutions
import launch_ros.actions

def generate_launch_description():
    return launch.LaunchDescription([
        launch_ros.actions.Node(package='lab2', executable='numeric_talker', name='my_talker'),
        launch_ros.actions.Node(package='lab2', executable='numeric_listener', name='my_listener'),
    ])
""",
        (
            "[INFO] [launch]: All log files can be found below ",
            "[INFO] [launch]: Default logging verbosity is set to INFO",
            STARTED,
            "[INFO] [numeric_listener-2]: process started with pid [",
            "[numeric_talker-1] args: --ros-args -r __node:=my_talker",
            "[numeric_talker-1] to stderr",
            "[numeric_talker-1] last line without newline",
            "[numeric_listener-2] args: --ros-args -r __node:=my_listener",
            CLEAN,
        ),
        whole=True,
    ),
    Case(
        "add-action",
        """\
from launch import LaunchDescription
from launch_ros.actions import Node

def generate_launch_description():
    ld = LaunchDescription()
    talker_node = Node(package="lab2", executable="numeric_talker", output="screen", emulate_tty=True)
    ld.add_action(talker_node)
    ld.add_entity(Node(package="lab2", executable="numeric_listener"))
    return ld
""",
        (STARTED, "[numeric_listener-2] args: --ros-args", "[numeric_talker-1] args: --ros-args\r"),
        whole=True,
    ),
    Case(
        "deep-imports",
        """\
from launch.launch_description import LaunchDescription
from launch_ros.actions.node import Node
from launch.actions.declare_launch_argument import DeclareLaunchArgument
from launch.substitutions.launch_configuration import LaunchConfiguration
from launch.launch_description_sources.python_launch_description_source import PythonLaunchDescriptionSource

def generate_launch_description():
    return LaunchDescription([Node(package='lab2', executable='numeric_talker')])
""",
        (STARTED,),
        whole=True,
    ),
    Case(
        "all-names",
        "talker(name='a', namespace='b', arguments=['x', 'y'], ros_arguments=['--log-level', 'info'],"
        " remappings=[('chatter', 'c'), ('d', '/e')])",
        ("args: x y --ros-args --log-level info --ros-args -r __node:=a -r __ns:=/b -r chatter:=c -r d:=/e",),
    ),
    Case(
        "names-of-substitutions",
        "DeclareLaunchArgument('who', default_value='bob'), talker(name=['x_', LaunchConfiguration('who')],"
        " namespace=LaunchConfiguration('who'), exec_name='label',"
        " remappings=[(['chat', 'ter'], LaunchConfiguration('who'))])",
        ("[label-1] args: --ros-args -r __node:=x_bob -r __ns:=/bob -r chatter:=bob",),
    ),
    Case("no-package", "Node(executable=os.path.join(HERE, '../../../lib/lab2/numeric_talker'))", (STARTED,)),
    Case("died", "Node(package='lab2', executable='failing')", ("process has died [pid ", "exit code 3, cmd '")),
    Case("killed", "Node(package='lab2', executable='killing_itself')", ("exit code -9, cmd '",)),
    Case("silence", "Node(package='lab2', executable='silent')", ("[silent-1]: process has finished cleanly",)),
    Case(
        "same-name-twice",
        "talker(name='n', namespace='/'), talker(name='n', namespace='/')",
        ("[WARNING] [numeric_talker-2]: there are now at least 2 nodes with the name /n created within this launch",),
    ),
    Case(
        "environment",
        "SetEnvironmentVariable('SHOWN', 'one'), Node(package='lab2', executable='show_env'),"
        " UnsetEnvironmentVariable('SHOWN'), Node(package='lab2', executable='show_env'),"
        " AppendEnvironmentVariable('SHOWN', 'a'), AppendEnvironmentVariable('SHOWN', 'b', prepend=True),"
        " AppendEnvironmentVariable('SHOWN', 'c', separator='-'), Node(package='lab2', executable='show_env'),"
        " Node(package='lab2', executable='show_env', additional_env={'SHOWN': EnvironmentVariable('SHOWN'), 'Q': '1'}),"
        " Node(package='lab2', executable='show_env', env={'SHOWN': 'only', 'PATH': os.environ['PATH']})",
        (
            "[show_env-1] SHOWN=one",
            "[show_env-2] SHOWN=unset",
            "[show_env-3] SHOWN=b:a-c",
            "[show_env-4] SHOWN=b:a-c",
            "[show_env-5] SHOWN=only",
        ),
    ),
    Case(
        "prefix-cwd-log-cmd",
        "Node(package='lab2', executable='where', prefix='env -u SHOWN', cwd='/', log_cmd=True),"
        " Node(package='lab2', executable='where', cwd='/usr')",
        ("[env-1] cwd: /", "[INFO] [env-1]: process details: cmd='env -u SHOWN /", "[where-2] cwd: /usr"),
    ),
    Case(
        "terminal",
        "Node(package='lab2', executable='is_tty', emulate_tty=True), Node(package='lab2', executable='is_tty')",
        ("[is_tty-1] 1 yes 2 yes", "[is_tty-2] 1 no 2 no"),
    ),
    Case(
        "terminal-by-configuration",
        "SetLaunchConfiguration('emulate_tty', 'true'), Node(package='lab2', executable='is_tty')",
        ("[is_tty-1] 1 yes 2 yes",),
    ),
    Case("output-format", "talker(output_format='<{line}>')", ("<args: --ros-args>",)),
    Case(
        "outputs",
        "talker(output='log'), talker(output={'both': 'screen'}), talker(output='own_log', cached_output=True)",
        ("[numeric_talker-3] args",),
    ),
    Case(
        "respawn",
        "Node(package='lab2', executable='failing', respawn=True, respawn_delay=0.05, respawn_max_retries=2)",
        ("[INFO] [failing-1]: process started with pid [",),
    ),
    Case(
        "on-exit",
        "Node(package='lab2', executable='failing_late', on_exit=Shutdown()), Node(package='lab2', executable='waiting')",
        (
            "[INFO] [launch]: process[failing_late-1] was required: shutting down launched system",
            "[INFO] [waiting-2]: sending signal 'SIGINT' to process[waiting-2]",
        ),
    ),
    Case("on-exit-list", "talker(on_exit=[LogInfo(msg='gone')])", ("[INFO] [launch.user]: gone",)),
    # --- parameters ---
    Case(
        "parameters",
        "Node(package='lab2', executable='show_parameters', name='p', parameters=[{"
        "'i': 1, 'f': 2.5, 'e': 1e-7, 'g': 1e22, 'b': True, 's': 'text', 'no': 'no', 'num': '12', 'empty': '',"
        " 'quote': 'a \"b\" \\\\ \\n ü', 'l': [1, 2], 'mixed': [1, 2.5], 'ls': ['a', 'b'], 'lb': [True, False],"
        " 'nested': {'a': {'b': 3}, 'c': 'd'}}])",
        (
            '"b": true',
            '"e": 1e-07',
            '"empty": ""',
            '"mixed": [1.0, 2.5]',
            '"nested.a.b": 3',
            '"nested.c": "d"',
            '"no": "no"',
            '"num": "12"',
            '[show_parameters-1] {"/**": {"ros__parameters": {',
        ),
    ),
    Case(
        "parameters-of-substitutions",
        "DeclareLaunchArgument('v', default_value='5'), SetLaunchConfiguration('w', 'yes'),"
        " Node(package='lab2', executable='show_parameters', name='p', namespace='q', parameters=[{"
        "'i': LaunchConfiguration('v'), 'b': LaunchConfiguration('w'), 'f': TextSubstitution(text='1.5'),"
        " 's': ['x', LaunchConfiguration('v')], 'l': TextSubstitution(text='[1, 2]'),"
        " 't': ParameterValue(LaunchConfiguration('v'), value_type=str), 'u': ParameterValue(7),"
        " ('na', 'me'): 1, 'list': [[LaunchConfiguration('v')], ['6']], 'e': TextSubstitution(text='')}])",
        ('"i": 7', '"b": true', '"s": "x7"', '"t": "7"', '"list": [7, 6]', '"/q/p": '),
        arguments=("v:=7",),
    ),
    Case(
        "parameters-of-files",
        "SetParametersFromFile([HERE, '/params.yaml']),"
        " talker(parameters=[os.path.join(HERE, 'params.yaml'), [HERE, '/params.yaml'],"
        " ParameterFile(os.path.join(HERE, 'params.yaml')), Parameter('z', 3), '/nowhere.yaml',"
        " PathJoinSubstitution([FindPackageShare('lab2'), 'launch', 'params.yaml'])])",
        ("[WARNING] [launch_ros.actions.node]: Parameter file path is not a file: /nowhere.yaml",),
        compare="-p z:=3 has a document end after it in the real one",
    ),
    Case(
        "set-parameter",
        "SetParameter(name='a', value=True), SetParameter('b', 2), SetParameter('c', 'x'), talker(),"
        " GroupAction([SetParameter('d', LaunchConfiguration('none', default='0.5')), talker()])",
        (
            "[numeric_talker-1] args: --ros-args -p a:=True -p b:=2 -p c:=x",
            "[numeric_talker-2] args: --ros-args -p a:=True -p b:=2 -p c:=x -p d:=0.5",
        ),
    ),
    Case("parameters-not-a-list", "talker(parameters={'a': 1})", ("'Node' expected 'parameters' to be one of",), 1),
    Case("parameters-mixed", "talker(parameters=[{'a': [1, 'b']}])", ("Expected a non-empty sequence, with",), 1),
    Case("parameters-none", "talker(parameters=[{'a': None}])", ("Unexpected type for parameter value None",), 1),
    # --- launch arguments and conditions ---
    Case(
        "arguments",
        "DeclareLaunchArgument('a', default_value='1', description='what for'), DeclareLaunchArgument('b'),"
        " DeclareLaunchArgument('c', default_value='x', choices=['x', 'y']),"
        " say(LaunchConfiguration('a'), LaunchConfiguration('b'), [LaunchConfiguration('c'), '!'])",
        ("[echo-1] 1 two x!",),
        arguments=("b:=one", "b:=two"),
    ),
    Case(
        "argument-missing",
        "DeclareLaunchArgument('a', description='what for')",
        (f"{CAUGHT}Included launch description missing required argument 'a' (description: 'what for'), given: []",),
        1,
    ),
    Case(
        "argument-not-a-choice",
        "DeclareLaunchArgument('a', default_value='x', choices=['x', 'y']), say('no')",
        (
            '[ERROR] [launch.actions.declare_launch_argument]: Argument "a" provided value "z" is not valid. Valid options',
        ),
        1,
        arguments=("a:=z",),
        absent=("[echo-1]",),
    ),
    Case("argument-default-not-a-choice", "DeclareLaunchArgument('a', default_value='z', choices=['x'])", (), 1),
    Case(
        "configuration-missing",
        "say(LaunchConfiguration('nope'))",
        (f"{CAUGHT}launch configuration 'nope' does not exist",),
        1,
    ),
    Case(
        "conditions",
        "DeclareLaunchArgument('on', default_value='true'),"
        " say('1', condition=IfCondition(LaunchConfiguration('on'))),"
        " say('2', condition=UnlessCondition(LaunchConfiguration('on'))),"
        " say('3', condition=IfCondition(PythonExpression([\"'\", LaunchConfiguration('on'), \"' == 'true'\"]))),"
        " say('4', condition=IfCondition(EqualsSubstitution(LaunchConfiguration('on'), True))),"
        " say('5', condition=IfCondition(NotSubstitution(LaunchConfiguration('on')))),"
        " say('6', condition=IfCondition(AndSubstitution('true', OrSubstitution('false', 'true')))),"
        " say('7', condition=UnlessCondition(AnySubstitution('false', AllSubstitution('true', 'false')))),"
        " say('8', condition=IfCondition(NotEqualsSubstitution('1.0', '1')))",
        ("[echo-1] 1", "[echo-2] 3", "[echo-3] 4", "[echo-4] 6", "[echo-5] 7"),
        absent=("[echo-6]",),
    ),
    Case(
        "condition-invalid",
        "say('1', condition=IfCondition('maybe'))",
        (f"{CAUGHT}invalid condition expression, expected one of [true, 1, false, 0] but got 'maybe', expanded from",),
        1,
    ),
    Case(
        "configuration-equals",
        "SetLaunchConfiguration('a', 'b'), say('1', condition=LaunchConfigurationEquals('a', 'b')),"
        " say('2', condition=LaunchConfigurationNotEquals('a', 'b')), UnsetLaunchConfiguration('a'),"
        " say('3', condition=LaunchConfigurationEquals('a', None))",
        ("[echo-1] 1", "[echo-2] 3"),
        compare="the real one's deprecation warning shows another file",
    ),
    # --- substitutions ---
    Case(
        "substitutions",
        "say(EnvironmentVariable('NO_SUCH', default_value='dflt'), PathJoinSubstitution(['a', 'b']),"
        " PythonExpression(['1 + ', '2']), PythonExpression('floor(2.5)'), TextSubstitution(text='t'),"
        " IfElseSubstitution('true', 'yes', 'no'), Command('echo hello'), FileContent(HERE + '/words')),"
        " say(ThisLaunchFileDir()), say(ThisLaunchFile()), say(FindPackageShare('lab2')),"
        " say(FindPackagePrefix(package='lab2')), say(ExecutableInPackage('numeric_talker', 'lab2')),"
        " say(FindExecutable(name='sh')), say(PythonExpression('sys.maxsize > 0', ['sys']))",
        ("[echo-1] dflt a/b 3 2 t yes hello", "/share/lab2/launch/case.py", "[echo-8] True"),
    ),
    Case("environment-missing", "say(EnvironmentVariable('NO_SUCH'))", ("'NO_SUCH' does not exist",), 1),
    Case("expression-wrong", "say(PythonExpression('1 +'))", (f"{CAUGHT}invalid syntax",), 1),
    Case("command-fails", "say(Command('false'))", (f"{CAUGHT}executed command failed. Command: false",), 1),
    Case("command-missing", "say(Command('no-such-command'))", (f"{CAUGHT}file not found: ",), 1),
    Case("command-stderr", "say(Command('ls /', on_stderr='maybe'))", ("expected 'on_stderr' to be one of",), 1),
    # --- groups and includes ---
    Case(
        "group",
        "SetLaunchConfiguration('a', 'out'), GroupAction([PushRosNamespace('g'), SetLaunchConfiguration('a', 'in'),"
        " SetRemap('x', 'y'), SetRemap(src='v', dst='w'), SetEnvironmentVariable('SHOWN', '1'),"
        " talker(remappings=[('x', 'z')]), GroupAction([PushROSNamespace('h'), talker(namespace='i')]),"
        " talker(namespace='/j'), say(LaunchConfiguration('a'), EnvironmentVariable('SHOWN'))]), talker(),"
        " say(LaunchConfiguration('a'), EnvironmentVariable('SHOWN', default_value='unset'))",
        (
            "[numeric_talker-1] args: --ros-args -r __ns:=/g -r x:=y -r v:=w -r x:=z",
            "[numeric_talker-2] args: --ros-args -r __ns:=/g/h/i -r x:=y -r v:=w",
            "[numeric_talker-3] args: --ros-args -r __ns:=/j -r x:=y -r v:=w",
            "[echo-4] in 1",
            "[numeric_talker-5] args: --ros-args\n",
            "[echo-6] out unset",
        ),
    ),
    Case(
        "group-variants",
        "SetLaunchConfiguration('a', '1'), GroupAction([SetLaunchConfiguration('b', '2')], scoped=False),"
        " GroupAction([say(LaunchConfiguration('a', default='none'), LaunchConfiguration('c'))], forwarding=False,"
        " launch_configurations={'c': LaunchConfiguration('b')}),"
        " GroupAction([say('never')], condition=IfCondition('false')), say(LaunchConfiguration('b'))",
        ("[echo-1] none 2", "[echo-2] 2"),
        absent=("never",),
    ),
    Case("namespace-invalid", "PushRosNamespace('a b')", ("The resulting namespace is invalid:",), 1),
    Case(
        "include",
        "IncludeLaunchDescription(PythonLaunchDescriptionSource(os.path.join(HERE, 'included.py')),"
        " launch_arguments={'x': '1'}.items()), IncludeLaunchDescription("
        "PythonLaunchDescriptionSource([ThisLaunchFileDir(), '/included.py']), launch_arguments=[('x', ['2'])]),"
        " IncludeLaunchDescription([FindPackageShare('lab2'), '/launch/included.py'],"
        " launch_arguments={'x': '3', 'y': LaunchConfiguration('x')}.items()),"
        " IncludeLaunchDescription(PathJoinSubstitution([HERE, 'included.py']), launch_arguments=[('x', '4')])",
        ("[echo-1] included 1 y", "[echo-2] included 2 y", "[echo-3] included 3 3", "[echo-4] included 4 3"),
    ),
    Case("include-missing-argument", "IncludeLaunchDescription(HERE + '/included.py')", (CAUGHT,), 1),
    Case(
        "include-missing-file",
        "talker(), IncludeLaunchDescription(PythonLaunchDescriptionSource(HERE + '/nope.py'))",
        (f"{CAUGHT}[Errno 2] No such file or directory: '",),
        1,
        absent=("numeric_talker",),
    ),
    Case("include-broken", "IncludeLaunchDescription(HERE + '/broken.py')", (" - NameError: name 'nme' is not",), 1),
    # --- other actions ---
    Case(
        "log-info",
        "LogInfo(msg='plain'), LogInfo(msg=['a ', LaunchConfiguration('x', default='b')])",
        ("[INFO] [launch.user]: plain", "[INFO] [launch.user]: a b"),
    ),
    Case(
        "execute-process",
        "ExecuteProcess(cmd=['echo', 'a', ['b', TextSubstitution(text='c')]], name='label', output='screen'),"
        " ExecuteProcess(cmd=['echo', 'x', '&&', 'echo', 'y'], shell=True), ExecuteProcess(cmd=['no-such-program'])",
        ("[label-1] a bc", "[echo-2] y", "[ERROR] [no-such-program-3]: exception occurred while executing process:"),
        compare="the traceback is another",
    ),
    Case(
        "timer",
        "TimerAction(period=0.3, actions=[say('late')]), TimerAction(period=60.0, actions=[say('never')],"
        " cancel_on_shutdown=True), TimerAction(period=LaunchConfiguration('t', default='0.6'), actions=[Shutdown()])",
        ("[echo-1] late",),
        absent=("never",),
    ),
    Case(
        "timer-of-int",
        "TimerAction(period=1, actions=[])",
        ("'TimerAction' expected 'period' to be one of [",),
        1,
        compare="the real one names the class of its own",
    ),
    Case(
        "opaque-function",
        "OpaqueFunction(function=lambda context, *a, **k: [say(a[0], k['z'],"
        " LaunchConfiguration('v').perform(context), context.launch_configurations['v'])], args=['A'], kwargs={'z': 'Z'})",
        ("[echo-1] A Z 4 4",),
        arguments=("v:=4",),
    ),
    Case("opaque-raises", "OpaqueFunction(function=lambda context: 1 / 0)", (f"{CAUGHT}division by zero",), 1),
    Case(
        "events-of-processes",
        "RegisterEventHandler(OnExecutionComplete(target_action=(t := talker()), on_completion=[LogInfo(msg='complete')])),"
        " t, RegisterEventHandler(OnProcessStart(target_action=t, on_start=[LogInfo(msg='begun')])),"
        " RegisterEventHandler(OnProcessExit(target_action=t, on_exit=[say('next')])),"
        " RegisterEventHandler(OnProcessExit(on_exit=lambda event, context: LogInfo("
        "msg=f'{event.process_name} {event.returncode}'))),"
        " RegisterEventHandler(OnProcessIO(target_action=t, on_stdout=lambda event: LogInfo("
        # Its second write comes with the first or after it: only what the first begins with is sure.
        "msg='io ' + event.text.decode().split()[0]) if event.text.startswith(b'args') else None)),"
        " RegisterEventHandler(OnShutdown(on_shutdown=[LogInfo(msg=['over: ', LocalSubstitution('event.reason')])]))",
        (
            "[INFO] [launch.user]: begun",
            "[echo-2] next",
            "[INFO] [launch.user]: numeric_talker-1 0",
            "[INFO] [launch.user]: echo-2 0",
            "[INFO] [launch.user]: complete",
            "[INFO] [launch.user]: io args:",
            "[INFO] [launch.user]: over: idle",
        ),
    ),
    Case(
        "signals-by-event",
        "(w := Node(package='lab2', executable='waiting')), (x := Node(package='lab2', executable='waiting')),"
        " TimerAction(period=0.5, actions=[EmitEvent(event=SignalProcess(signal_number=signal.SIGTERM,"
        " process_matcher=matches_action(w))), EmitEvent(event=ShutdownProcess(process_matcher=matches_action(x)))])",
        (
            "[INFO] [waiting-1]: sending signal 'SIGTERM' to process[waiting-1]",
            "exit code -15, cmd '",
            "[INFO] [waiting-2]: sending signal 'SIGINT' to process[waiting-2]",
        ),
    ),
    Case("shutdown-at-once", "talker(), Shutdown(reason='enough')", (), compare="a race of the real one's"),
    Case(
        "twice-in-one-description",
        "(t := talker()), t",
        (f"{CAUGHT}ExecuteLocal action 'numeric_talker-2': executed more than once: <",),
        1,
        compare="the real one shows the class of its own",
    ),
    # --- what students get wrong ---
    Case(
        "executable-missing",
        "talker(), Node(package='lab2', executable='numeric_listner')",
        (f"{CAUGHT}executable 'numeric_listner' not found on the libexec directory '",),
        1,
        absent=("numeric_talker",),
    ),
    Case("package-missing", "Node(package='lab3', executable='x')", (f"{CAUGHT}\"package 'lab3' not found, sea",), 1),
    Case("package-name-wrong", "Node(package='lab 2', executable='x')", ("'lab 2' is not a valid package name",), 1),
    Case("package-without-programs", "Node(package='bare', executable='x')", ("libexec directory '",), 1),
    Case("node-name-space", "talker(name='my talker')", ("Invalid node name: node name must not contain",), 1),
    Case("node-name-number", "talker(name='1talker')", ("node name must not start with a number",), 1),
    Case("node-name-empty", "talker(name='')", ("node name must not be empty",), 1),
    Case("namespace-number", "talker(namespace='1a')", ("must not have a token that starts with a number",), 1),
    Case("namespace-repeated", "talker(namespace='a//b')", ("must not contain repeated '/'",), 1),
    Case("namespace-space", "talker(namespace='a b')", ("namespace must not contain characters other than",), 1),
    Case("remap-not-a-tuple", "talker(remappings=['chatter:=x'])", ("xpected 'remap_rule' to be one of",), 1),
    Case("remap-of-three", "talker(remappings=[('a', 'b', 'c')])", ("remap_rule must be a tuple of length 2",), 1),
    Case("respawn-text", "talker(respawn='true')", ("value='true' is not an instance of <class 'bool'>",), 1),
    Case("misspelt-argument", "Node(pakage='lab2', executable='x')", ("unexpected keyword argument 'pakage'",), 1),
    Case("old-argument", "Node(package='lab2', node_executable='x')", (" - TypeError: ",), 1),
    Case("positional", "Node('lab2', 'numeric_talker')", (" - TypeError: ",), 1),
    Case("not-an-entity", "5", (f"{CAUGHT}'int' object has no attribute 'describe_sub_entities'",), 1),
    Case("nested-list", "[talker()]", (f"{CAUGHT}'list' object has no attribute 'describe_sub_entities'",), 1),
    Case("number-for-text", "say(5)", (CAUGHT,), 1),
    Case(
        "misspelt-import",
        "from launch import LaunchDescripton\n",
        (" - ImportError: cannot import name 'LaunchDescripton' from 'launch' (",),
        1,
        whole=True,
    ),
    Case(
        "wrong-module",
        "from launch.actions import Node\n",
        (" - ImportError: cannot import name 'Node' from 'launch.actions' (",),
        1,
        whole=True,
    ),
    Case(
        "module-missing",
        "import launch.action_s\n",
        (" - ModuleNotFoundError: No module named 'launch.action_s'",),
        1,
        whole=True,
    ),
    Case(
        "attribute-missing",
        "import launch\ndef generate_launch_description():\n    return launch.LaunchDescrption([])\n",
        (" - AttributeError: module 'launch' has no attribute 'LaunchDescrption'",),
        1,
        whole=True,
    ),
    Case(
        "method-missing",
        "from launch import LaunchDescription\n"
        "def generate_launch_description():\n    return LaunchDescription().add_node()\n",
        (" - AttributeError: 'LaunchDescription' object has no attribute 'add_node'",),
        1,
        whole=True,
    ),
    Case(
        "syntax",
        "def generate_launch_description(:\n",
        (" - SyntaxError: invalid syntax (case.py, line 1)",),
        1,
        whole=True,
    ),
    Case(
        "no-function",
        "x = 1\n",
        ("does not contain the required function 'generate_launch_description()'",),
        1,
        whole=True,
    ),
    Case(
        "returns-nothing",
        "def generate_launch_description():\n    pass\n",
        (f"{CAUGHT}'NoneType' object has",),
        1,
        whole=True,
    ),
    Case("raises", "def generate_launch_description():\n    raise OSError('no')\n", (" - OSError: no",), 1, whole=True),
    Case("empty-file", "", ("does not contain the required function",), 1, whole=True),
    Case("nothing-to-do", "", ("Default logging verbosity is set to INFO",)),
)
