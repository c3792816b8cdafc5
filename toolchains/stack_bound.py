#!/usr/bin/env python3
"""Upper bound of an image's stack, or the reason why there is none.

  stack_bound.py --objdump OBJDUMP --elf IMAGE --ci DIRECTORY.. --root FUNCTION.. [--limit BYTES]

Frames come from the compiler (-fcallgraph-info=su,da, the .ci files), calls from there and from the disassembly, which
also shows what the compiler does not record (calls of its own library). Frames of library functions, which have no .ci
file, are read off their code. The first root is where execution starts; every other one is an interrupt handler that
may come on top once. Indirect calls, recursion, frames of unknown size and unknown functions are errors.
"""
import argparse
import pathlib
import re
import subprocess
import sys

# What the processor stacks on an exception: 8 words, 26 with floating-point registers, and one to align (DDI 0403, B1.5.6).
EXCEPTION_FRAME = 4 * 27


class NoBound(Exception):
    pass


class Function:
    def __init__(self):
        self.frame = None
        self.calls = set()
        self.problems = []


def read_ci(text, functions):
    for title, label in re.findall(r'^node: \{ title: "([^"]*)" label: "([^"]*)"', text, re.M):
        size = re.search(r'\\n(\d+) bytes \(([^)]*)\)', label)
        if not size:
            continue  # declared here, defined elsewhere
        function = functions.setdefault(title.split(':')[-1], Function())
        function.frame = max(function.frame or 0, int(size[1]))
        if size[2] not in ('static', 'dynamic,bounded'):
            function.problems.append(f'stack of unknown size ({size[2]})')
    for source, target in re.findall(r'^edge: \{ sourcename: "([^"]*)" targetname: "([^"]*)"', text, re.M):
        function = functions.setdefault(source.split(':')[-1], Function())
        if target == '__indirect_call':
            function.problems.append('indirect call')
        else:
            function.calls.add(target.split(':')[-1])


def registers(operands):
    """How many registers a list like {r4, r6-r8, lr} names."""
    count = 0
    for part in re.search(r'\{(.*)\}', operands)[1].split(','):
        first, _, last = part.strip().partition('-')
        count += int(last[1:]) - int(first[1:]) + 1 if last else 1
    return count


def read_disassembly(text, functions):
    name, function = None, None
    known = set(functions)
    starts = [(int(head[1], 16), head[2]) for head in re.finditer(r'^([0-9a-f]+) <(.+)>:$', text, re.MULTILINE)]
    heads = {head for _, head in starts}

    def named(operands):
        """Where a branch goes. Its label may be any symbol of about that value, so that the address decides."""
        target = re.search(r'([0-9a-f]+) <([^>+]+)(\+?)', operands)
        if not target or target[2] in heads:
            return operands
        address = int(target[1], 16)
        begin, head = max((start for start in starts if start[0] <= address), default=(None, None))
        if head is None:
            return operands
        return f'{target[1]} <{head}>' if begin == address else f'{target[1]} <{head}+{address - begin:#x}>'

    for line in text.splitlines():
        if head := re.match(r'^[0-9a-f]+ <(.+)>:$', line):
            name = head[1]
            function = functions.setdefault(name, Function())
            continue
        code = re.match(r'^ *[0-9a-f]+:\t(\S+)(?:\t(.*))?$', line)
        if not code or function is None:
            continue
        operation, operands = code[1].removesuffix('.n').removesuffix('.w'), named(code[2] or '')
        if target := re.search(r'<([^>+]+)>', operands):
            # A branch into another function is a tail call.
            if operation.startswith('b') and (operation in ('bl', 'blx') or target[1] != name):
                function.calls.add(target[1])
        elif operation == 'bl' and f'<{name}+' in operands:
            pass  # Armv6-M's far jump within a function
        elif operation in ('bl', 'blx') or (operation == 'bx' and operands.split()[0] != 'lr'):
            function.problems.append(f'indirect call ({operation} {operands})')
        if name in known:
            continue
        function.frame = function.frame or 0
        if operation == 'push' or (operation == 'stmdb' and operands.startswith('sp!')):
            function.frame += 4 * registers(operands)
        elif operation == 'vpush':
            function.frame += 8 * registers(operands)
        elif decrement := re.match(r'sp, (?:sp, )?#(\d+)', operands) if operation in ('sub', 'subw') else None:
            function.frame += int(decrement[1])
        elif decrement := re.search(r'\[sp, #-(\d+)\]!', operands):
            function.frame += int(decrement[1])
        elif re.match(r'sp, (?!sp|#)', operands) and operation in ('sub', 'mov', 'subs', 'subw', 'add'):
            function.problems.append(f'stack of unknown size ({operation} {operands})')


def bound(name, functions, path=()):
    if name in path:
        raise NoBound('recursion: ' + ' -> '.join([*path[path.index(name):], name]))
    function = functions.get(name)
    if function is None or function.frame is None:
        raise NoBound(f'unknown function {name}' + (f', called from {path[-1]}' if path else ''))
    if function.problems:
        raise NoBound(f'{name}: {function.problems[0]}')
    return function.frame + max((bound(callee, functions, (*path, name)) for callee in sorted(function.calls)), default=0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--objdump')
    parser.add_argument('--elf')
    parser.add_argument('--disassembly', type=pathlib.Path, help='text of objdump -d instead of --objdump and --elf')
    parser.add_argument('--ci', nargs='*', type=pathlib.Path, default=[])
    parser.add_argument('--root', nargs='+', required=True)
    parser.add_argument('--limit', type=int)
    arguments = parser.parse_args()

    functions = {}
    for directory in arguments.ci:
        for file in sorted(directory.rglob('*.ci')):
            read_ci(file.read_text(), functions)
    if arguments.elf:
        text = subprocess.run([arguments.objdump, '-d', '--no-show-raw-insn', arguments.elf], check=True,
                              capture_output=True, text=True).stdout
    else:
        text = arguments.disassembly.read_text() if arguments.disassembly else ''
    read_disassembly(text, functions)
    try:
        total = sum(bound(root, functions) for root in arguments.root) + EXCEPTION_FRAME * (len(arguments.root) - 1)
    except NoBound as reason:
        sys.exit(f'stack_bound: {reason}')
    if arguments.limit is not None and total > arguments.limit:
        sys.exit(f'stack_bound: {total} bytes may be needed, {arguments.limit} are there')
    print(total)


if __name__ == '__main__':
    main()
