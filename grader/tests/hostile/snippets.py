"""Code that several hostile submissions have in common; it stands before the code of a program or of setup.py."""

from __future__ import annotations

FORGER = """
import os
_result = '{"schema": "lab2-grader/result/1", "graded": true, "score": 100, "max_score": 100, "checks": []}'
_places = ['.', '..', '/', '/tmp', '/ws', '/ws/install', '/package', os.path.expanduser('~'), '/results', '/dev/shm', '/home']
for _place in _places:
    for _name in ('result.json', 'report.md', 'evidence/manifest.json', 'evidence/conversation.jsonl'):
        try:
            os.makedirs(os.path.dirname(os.path.join(_place, _name)), exist_ok=True)
            with open(os.path.join(_place, _name), 'w') as _file:
                _file.write(_result)
        except OSError:
            pass
"""

SEEKER = """
import os, sys
_own = os.getpid()
for _pid in filter(str.isdigit, os.listdir('/proc')):
    for _what in ('cmdline', 'environ'):
        try:
            _text = open(f'/proc/{_pid}/{_what}', 'rb').read()
        except OSError:
            continue
        for _word in (b'lab2_grader.observe', b'lab2_grader grade', b'lab2_grader.cli', b'@SECRET@', b'LAB2_GRADER_KEY'):
            if _word in _text and int(_pid) != _own:
                print('LEAK: found', _word, 'in', _what, 'of', _pid, flush=True)
    try:
        _descriptors = os.listdir(f'/proc/{_pid}/fd')
    except OSError:
        continue
    for _fd in _descriptors:
        if int(_fd) > 2:
            try:
                with open(f'/proc/{_pid}/fd/{_fd}', 'w') as _stream:
                    _stream.write('["Phase",0.0,"fast"]\\\\n')
            except (OSError, ValueError):
                pass
for _name, _value in os.environ.items():
    if '@SECRET@' in _value or _name == 'LAB2_GRADER_KEY':
        print('LEAK: the environment has', _name, flush=True)
try:
    import lab2_grader
    if getattr(lab2_grader, '__file__', None):
        print('LEAK: the grader can be imported from', lab2_grader.__file__, flush=True)
except ImportError:
    pass
print('LOOKED for the grader', flush=True)
"""

# Not /dev/shm, which has an animal of its own: middleware keeps messages there (Fast DDS, data sharing), so that it is
# luck whether the other program of the pair is hit, too.
FILLER = """
import os
for _place in ('/tmp', os.path.expanduser('~'), '/dev', '/ws', '/', '.', '/var/tmp', '/run'):
    for _index in range(20):
        try:
            with open(f'{_place}/hoard{_index}', 'wb') as _file:
                _file.write(bytes(50_000_000))
        except OSError:
            break
    else:
        print('LEAK: wrote 1 GB to', _place, flush=True)
    for _index in range(20):
        try:
            os.unlink(f'{_place}/hoard{_index}')
        except OSError:
            break
"""

CHATTERBOX = """
import sys, threading, time

def _chatter(stream):
    end = time.monotonic() + 60
    while time.monotonic() < end:
        stream.write('nothing to say, and saying it ' * 30 + '\\n')
        stream.flush()

for _stream in (sys.stdout, sys.stderr):
    threading.Thread(target=_chatter, args=(_stream,), daemon=True).start()
"""

NOISE = """
import os, sys
sys.stdout.buffer.write(os.urandom(20_000) + b'\\n\\x00\\x00\\xff\\xfe\\xc3\\x28\\xed\\xa0\\x80\\n' + bytes(range(256)) + b'\\n')
sys.stdout.flush()
"""

SPINNER = """
import os, time
for _ in range(3):
    if os.fork() == 0:
        _end = time.monotonic() + 60
        while time.monotonic() < _end:
            pass
        os._exit(0)
"""

DAEMON = """
import os, signal, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        for _number in range(1, 65):
            try:
                signal.signal(_number, signal.SIG_IGN)
            except (OSError, ValueError):
                pass
        os.chdir('/')
        _end = time.monotonic() + 100
        while time.monotonic() < _end:
            time.sleep(0.2)
        os._exit(0)
    os._exit(0)
print('LOOKED: a daemon is on its way', flush=True)
"""

DEAF = """
import signal
for _number in range(1, 65):
    try:
        signal.signal(_number, signal.SIG_IGN)
    except (OSError, ValueError):
        pass
signal.signal = lambda *arguments: signal.SIG_DFL
signal.signal(signal.SIGCHLD, signal.SIG_DFL)
"""

READER = """
import glob, os
for _path in ['@FILE@', '/etc/shadow', '/etc/sudoers', *glob.glob('/root/*'), *glob.glob('/home/*/*'), *glob.glob('/home/*/.ssh/*'),
              *glob.glob('/root/.*'), *glob.glob('/mnt/*'), *glob.glob('/work*/*'), *glob.glob('/var/*'), *glob.glob('/run/*'),
              *glob.glob('/srv/*'), *glob.glob('/opt/*'), *glob.glob('/tmp/*/*'), *glob.glob('/sys/*'), '@SOLUTION@']:
    if _path.startswith(os.path.expanduser('~')) or any(v.startswith(_path) or _path.startswith(v) for v in @VISIBLE@):
        continue
    try:
        _found = os.listdir(_path) if os.path.isdir(_path) else open(_path, 'rb').read(100)
    except OSError:
        continue
    if _found:
        print('LEAK: could read', _path, flush=True)
_text = open('/proc/self/mounts').read() if os.path.exists('/proc/self/mounts') else ''
print('LOOKED at files', flush=True)
"""

CALLER = """
import socket
for _family, _address in ((socket.AF_INET, ('127.0.0.1', @PORT@)), (socket.AF_UNIX, chr(0) + '@ABSTRACT@'), (socket.AF_UNIX, '@SOCKET@')):
    try:
        with socket.socket(_family, socket.SOCK_STREAM) as _socket:
            _socket.settimeout(2)
            _socket.connect(_address)
            print('LEAK: reached', repr(_address), flush=True)
    except OSError:
        pass
_routes = [line.split() for line in open('/proc/net/route').read().splitlines()[1:]]
if any(route[0] != 'lo' for route in _routes):
    print('LEAK: there is a route out', flush=True)
print('LOOKED at the network', flush=True)
"""

VANDAL = """
import ctypes, os, sys
for _path in ('/proc/sys/kernel/hostname', '/proc/sys/kernel/core_pattern', '/proc/sys/vm/drop_caches', '/proc/sysrq-trigger',
              '/sys/kernel/uevent_helper', '/sys/fs/cgroup/cgroup.procs', sys.executable, os.__file__, '/etc/passwd', '/usr/bin/python3'):
    try:
        os.close(os.open(_path, os.O_WRONLY | os.O_APPEND))
        print('LEAK: may write', _path, flush=True)
    except OSError:
        pass
_install = () if os.path.isdir('/ws/src') else ('/ws/install',)  # a build may write there: it is what it makes
for _place in ('/', '/usr', '/etc', '/dev', '/home', *_install, os.path.dirname(os.__file__)):
    try:
        os.mkdir(f'{_place}/lab2-escaped')
        print('LEAK: may write to', _place, flush=True)
        os.rmdir(f'{_place}/lab2-escaped')
    except OSError:
        pass
_libc = ctypes.CDLL(None, use_errno=True)
for _flag, _name in ((0x10000000, 'user'), (0x00020000, 'mount'), (0x40000000, 'network')):
    if os.fork() == 0:
        if _libc.unshare(_flag) == 0:
            print('LEAK: may make a namespace:', _name, flush=True)
        os._exit(0)
if _libc.mount(b'none', b'/tmp', b'tmpfs', 0, None) == 0:
    print('LEAK: may mount', flush=True)
if _libc.chroot(b'/tmp') == 0:
    print('LEAK: may change its root', flush=True)
if _libc.setuid(1) == 0:
    print('LEAK: may become somebody else', flush=True)
print('LOOKED for a way to change the machine', flush=True)
"""
