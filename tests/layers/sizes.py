#!/usr/bin/env python3
"""Sizes in host_tools: no file over 500 lines, no function over 80 but those of sizes_allowed.txt.

  sizes.py [ROOT]    prints what is too long and not on the list, and what is on the list and short enough

A line of the list: FILE, or FILE:FUNCTION, then why after '#'.
"""
import argparse
import pathlib
import re
import sys

LONGEST_FILE = 500
LONGEST_FUNCTION = 80
LIST = 'tests/layers/sizes_allowed.txt'

# What is no code, with its line breaks: comments, raw strings, strings, characters (and not the ' of 1'000).
NO_CODE = re.compile(r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<![0-9a-fA-F])\'(?:\\.|[^\'\\\n])+\'', re.S)
PREPROCESSOR = re.compile(r'^[ \t]*#(?:[^\n]*\\\n)*[^\n]*', re.M)
NAME = re.compile(r'(~?\w+(?:::~?\w+)*|operator\s*\S{1,3})\s*\(')
NOT_A_FUNCTION = re.compile(r'^(?:if|for|while|switch|catch|else|do|try|return)\b')


def code_of(text):
    blank = lambda match: '""' + '\n' * match.group(0).count('\n')
    return PREPROCESSOR.sub(lambda m: '\n' * m.group(0).count('\n'), NO_CODE.sub(blank, text))


def function_name(head):
    """Of the text before a '{'; None where no function begins there."""
    head = re.sub(r'\s+', ' ', head).strip()
    head = re.sub(r'^(?:(?:public|private|protected) ?: ?)+', '', head)
    head = re.sub(r'^template ?<(?:[^<>]|<(?:[^<>]|<[^<>]*>)*>)*> ?', '', head)
    if '(' not in head or NOT_A_FUNCTION.match(head):
        return None
    if re.match(r'^(?:namespace|class|struct|union|enum|extern)\b', head) or re.search(r'(?<![=!<>])=(?!=)', head[:head.index('(')]):
        return None
    found = NAME.search(head)
    return found.group(1) if found else None


def functions_of(text):
    """(name, first line of its head, lines) of every function outside of functions: lambdas count for the one around."""
    code = code_of(text)
    depth, inside, begun, line = 0, None, 0, 1
    head_from, head_line = 0, None
    for place, char in enumerate(code):
        if char == '\n':
            line += 1
        if inside is None and head_line is None and not char.isspace():
            head_from, head_line = place, line
        if char == '{':
            if inside is None:
                name = function_name(code[head_from:place])
                if name:
                    inside, begun = (name, head_line), depth
                else:
                    head_line = None
            depth += 1
        elif char == '}':
            depth -= 1
            if inside is not None and depth == begun:
                rest = code[place + 1:].lstrip()
                if rest[:1] in (',', '{'):  # a braced member of a constructor's list; its body comes
                    continue
                yield inside[0], inside[1], line - inside[1] + 1
                inside, head_line = None, None
            elif inside is None:
                head_line = None
        elif char == ';' and inside is None:
            head_line = None


def too_long(root):
    """(what as the list names it, line for people)"""
    for path in sorted((root / 'host_tools').glob('*/*')):
        if path.suffix not in ('.hpp', '.cpp'):
            continue
        file, text = str(path.relative_to(root)), path.read_text()
        lines = text.count('\n')
        if lines > LONGEST_FILE:
            yield file, f'{file}: {lines} lines, more than {LONGEST_FILE}: give a part of it a file of its own'
        for name, line, count in functions_of(text):
            if count > LONGEST_FUNCTION:
                yield f'{file}:{name}', f'{file}:{line}: {name} has {count} lines, more than {LONGEST_FUNCTION}'


def allowed(root):
    lines = (root / LIST).read_text().splitlines()
    return [line.split('#')[0].strip() for line in lines if line.split('#')[0].strip()]


def complaints(root):
    found, names = list(too_long(root)), allowed(root)
    lines = [text for what, text in found if what not in names]
    known = {what for what, _ in found}
    return lines + [f'{LIST}: {name} is short enough: take it off' for name in names if name not in known]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('root', nargs='?', type=pathlib.Path, default=pathlib.Path(__file__).resolve().parents[2])
    lines = complaints(parser.parse_args().root)
    print('\n'.join(lines) or f'no file over {LONGEST_FILE} lines, no function over {LONGEST_FUNCTION} but those of {LIST}')
    return 1 if lines else 0


if __name__ == '__main__':
    sys.exit(main())
