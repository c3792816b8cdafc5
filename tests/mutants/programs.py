"""Test programs, built without CMake: one compiler call for each source that sees a change, objects kept by content."""
import dataclasses
import fnmatch
import hashlib
import os
import pathlib
import re
import resource
import shutil
import signal
import subprocess
import tempfile
import threading

INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)
# What the compiler says where a check at compile time fails: a test like any other. Every other error only says that
# the change makes no program.
FAILED_CHECK = re.compile(r'static assertion failed|non-constant condition|not a constant expression|in a constant expr|'
                          r'overflow in constant|outside the bounds|non-.?constexpr.? function|constexpr\W? loop iteration|'
                          r'constexpr evaluation|call to consteval|accessing uninitialized member|constraints not satisfied')
SANITIZERS = ['-fsanitize=address,undefined', '-fno-sanitize-recover=all']
OUT_OF_TIME = 'out of time'
LONGEST_COMPILATION_S = 600  # of processor time; a change that keeps the compiler longer computes without end
LONGEST_TEST_S = 120         # where it is not known yet
KEPT_OUTPUT = 20_000         # characters of what a test says, from its end
LEAST_TIME_S = 10            # of processor time for a test, however quick it is
TIMES_AS_LONG = 10           # a test that takes so many times as long as without the change does not end
MEMORY_BYTES = 4 << 30


@dataclasses.dataclass(frozen=True)
class Program:
    """One test program of programs.toml."""
    name: str
    sources: tuple = ()
    definitions: tuple = ()
    libraries: tuple = ()
    optimise: int = 1
    command: str = ''       # instead of sources: a shell command, run in the changed tree
    sees: tuple = ()        # with `command`: which files it sees, as patterns
    sanitize: bool = True
    slow: bool = False
    seconds: float = 10     # of processor time to build and run it, about: cheap ones are asked first


@dataclasses.dataclass
class Outcome:
    result: str             # passed, failed, invalid
    why: str = ''
    seconds: float = 0      # processor time, all of it
    run_seconds: float = 0  # of it, running


def _limits(cpu_s, memory):
    def set_limits():
        resource.setrlimit(resource.RLIMIT_CPU, (int(cpu_s) + 1, int(cpu_s) + 2))
        if memory:
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    return set_limits


def run_limited(command, cwd, cpu_s, memory=True, environment=None, kept=KEPT_OUTPUT):
    """(status, the last `kept` characters of the output, processor seconds); status None: out of time. Counts processor
    time, for others use the machine too; a test that sleeps for ever ends by the clock."""
    with tempfile.TemporaryFile() as out:
        process = subprocess.Popen(command, cwd=cwd, stdout=out, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                                   preexec_fn=_limits(cpu_s, memory), env={**os.environ, **(environment or {})},
                                   start_new_session=True)
        slept = threading.Timer(20 * cpu_s + 60, os.killpg, (process.pid, signal.SIGKILL))
        slept.start()
        _, status, usage = os.wait4(process.pid, 0)
        slept.cancel()
        process.returncode = status = os.waitstatus_to_exitcode(status)
        out.seek(0)
        text = out.read()[-kept:].decode(errors='replace')
    if status in (-signal.SIGKILL, -signal.SIGXCPU) or status != 0 and 'CPU time limit exceeded' in text:
        status = None
    return status, text, usage.ru_utime + usage.ru_stime


class Tree:
    """A copy of the project's tree in which one file at a time is changed, and what is built of it."""

    def __init__(self, project, work, number, folders, headers, includes):
        self.root = work / f'tree-{number}'
        self.changed = work / f'changed-{number}'
        self.objects = work / 'objects'  # of all trees
        self.includes = includes
        self.headers = headers
        self.texts = {}
        self.original = None
        shutil.rmtree(self.root, ignore_errors=True)
        for folder in folders:
            shutil.copytree(project / folder, self.root / folder, symlinks=True,
                            ignore=shutil.ignore_patterns('build', '__pycache__'))
        shutil.rmtree(self.changed, ignore_errors=True)
        self.changed.mkdir(parents=True)
        self.objects.mkdir(parents=True, exist_ok=True)

    # --- the change ---

    def text(self, file):
        if file not in self.texts:
            path = self.root / file
            self.texts[file] = path.read_text() if path.is_file() else ''
        return self.texts[file]

    def change(self, file, text):
        assert self.original is None
        self.original = (file, self.text(file))
        self._write(file, text)

    def restore(self):
        if self.original is not None:
            self._write(*self.original)
            self.original = None
            for left in self.changed.iterdir():
                left.unlink()

    def _write(self, file, text):
        (self.root / file).write_text(text)
        self.texts[file] = text

    # --- what sees what ---

    def seen_by(self, source):
        """Files that a source includes, itself among them. #if is not looked at: rather one too many."""
        seen, left = set(), [source]
        while left:
            file = left.pop()
            if file in seen:
                continue
            seen.add(file)
            for name in INCLUDE.findall(self.text(file)):
                beside = os.path.normpath(os.path.join(os.path.dirname(file), name))
                for candidate in (beside, name):
                    if (self.root / candidate).is_file():
                        left.append(candidate)
        return seen

    def program_sees(self, program, file):
        if program.command:
            return any(fnmatch.fnmatch(file, pattern) for pattern in program.sees)
        return any(file in self._files_of(program, source) for source in program.sources)

    def _files_of(self, program, source):
        named = {m for d in program.definitions for m in re.findall(r'[\w/.-]+\.hpp', d) if (self.root / m).is_file()}
        return self.seen_by(source).union(*(self.seen_by(n) for n in named))

    # --- building ---

    def _flags(self, program, sanitize):
        flags = ['-std=c++20', f'-O{program.optimise}', '-w', '-fmax-errors=1', '-I.', *self.includes]
        return flags + (SANITIZERS if sanitize else [])

    def _precompiled(self, flags):
        """The libraries' headers, read once."""
        text = ''.join(f'#include <{h}>\n' for h in self.headers)
        folder = self.objects / hashlib.sha256((text + repr(flags)).encode()).hexdigest()[:20]
        header = folder / 'precompiled.hpp'
        if not (folder / 'precompiled.hpp.gch').exists():
            folder.mkdir(exist_ok=True)
            header.write_text(text)
            building = folder / f'{os.getpid()}.gch'
            status, output, _ = run_limited(['g++', *flags, '-x', 'c++-header', header, '-o', building],
                                            self.root, LONGEST_COMPILATION_S, memory=False)
            if status != 0:
                raise RuntimeError(f'the headers of the libraries do not compile:\n{output}')
            building.rename(folder / 'precompiled.hpp.gch')
        return ['-include', str(header)]

    def _compile(self, program, source, sanitize):
        """(object, Outcome)"""
        flags = self._flags(program, sanitize) + [f'-D{d}'.replace('@ROOT@', str(self.root))
                                                  for d in program.definitions]
        contents = [(f, self.text(f)) for f in sorted(self._files_of(program, source))]
        key = hashlib.sha256(repr((flags, self.headers, source, contents)).encode()).hexdigest()[:24] + '.o'
        if (self.objects / key).exists():
            return self.objects / key, Outcome('passed')
        new = (self.changed if self.original else self.objects) / key
        if new.exists():
            return new, Outcome('passed')
        building = new.with_suffix(f'.{os.getpid()}')
        status, output, seconds = run_limited(
            ['g++', *flags, *self._precompiled(self._flags(program, sanitize)), '-c', source, '-o', building],
            self.root, LONGEST_COMPILATION_S, memory=False)
        if status == 0:
            building.rename(new)
            return new, Outcome('passed', seconds=seconds)
        if 'No such file' in output:
            raise RuntimeError(f'{source} does not compile:\n{output}')
        error = next((line for line in output.split('\n') if 'error:' in line), output[-300:].strip())
        error = error.replace(str(self.root) + '/', '')
        if status is None:
            return None, Outcome('failed', OUT_OF_TIME, seconds)
        return None, Outcome('failed' if FAILED_CHECK.search(output) else 'invalid', error, seconds)

    def normal_seconds(self, program, sanitize=False):
        """What running takes without a change; also makes sure that it passes then. Kept by content."""
        assert self.original is None
        files = set().union(*(self._files_of(program, s) for s in program.sources))
        if program.command:
            files = {str(f.relative_to(self.root)) for f in self.root.rglob('*') if f.is_file()
                     and self.program_sees(program, str(f.relative_to(self.root)))}
        contents = [(f, self.text(f)) for f in sorted(files)]
        key = hashlib.sha256(repr((program, sanitize, contents)).encode()).hexdigest()[:24] + '.normal'
        if not (self.objects / key).exists():
            outcome = self.run(program, sanitize)
            if outcome.result != 'passed':
                raise RuntimeError(f'{program.name} fails without any change: {outcome.why}')
            (self.objects / key).write_text(str(outcome.run_seconds))
        return float((self.objects / key).read_text())

    def run(self, program, sanitize=False, normal_s=None):
        """Builds and runs one program. normal_s: what running it takes without a change."""
        limit = max(LEAST_TIME_S, TIMES_AS_LONG * (LONGEST_TEST_S if normal_s is None else normal_s))
        if program.command:
            status, output, seconds = run_limited(['bash', '-c', program.command], self.root, limit, memory=False)
            return self._judged(status, output, 0, seconds)
        objects, spent = [], 0.0
        for source in program.sources:
            file, outcome = self._compile(program, source, sanitize)
            spent += outcome.seconds
            if file is None:
                outcome.seconds = spent
                return outcome
            objects.append(str(file))
        executable = self.changed / f'{program.name}.run'
        flags = SANITIZERS if sanitize else []
        status, output, seconds = run_limited(['g++', *flags, *objects, '-o', executable,
                                               *(f'-l{x}' for x in program.libraries)], self.root, 120, memory=False)
        spent += seconds
        if status != 0:
            return Outcome('invalid', 'link: ' + output[-300:].strip(), spent)
        status, output, seconds = run_limited([executable], self.root, limit, memory=not sanitize, environment={
            'RC_PARAMS': 'seed=1', 'GTEST_FAIL_FAST': '1', 'GTEST_BRIEF': '1', 'ASAN_OPTIONS': 'detect_leaks=0'})
        executable.unlink()
        return self._judged(status, output, spent, seconds)

    @staticmethod
    def _judged(status, output, built_s, run_s):
        if status == 0:
            return Outcome('passed', '', built_s + run_s, run_s)
        if status is None:
            return Outcome('failed', OUT_OF_TIME, built_s + run_s, run_s)
        test = re.search(r'\[  FAILED  \] ([\w./]+)|ERROR: (AddressSanitizer[^\n]*)|(runtime error:[^\n]*)', output)
        why = next(g for g in test.groups() if g) if test else f'status {status}'
        return Outcome('failed', why, built_s + run_s, run_s)
