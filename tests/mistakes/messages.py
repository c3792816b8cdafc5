#!/usr/bin/env python3
"""messages.py [--update]: docs/guide/messages.md is made of mistakes.toml: what was done, what the program says, the cure. Without
--update it only compares. A mistake that ends with a message has to have a cure."""
import pathlib
import re
import sys
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
PAGE = HERE.parents[1] / 'docs/guide/messages.md'
MARK = '<!-- made by tests/mistakes/messages.py --update -->'
SILENT = 'RMSE on the test logs'  # what is said where there is nothing to complain of


def sections(text):
    """(title, names of its mistakes): the lines of comments between the entries are titles."""
    title, names = None, []
    for line in text.split('\n'):
        comment = re.match(r'# ([A-Z][^.:]*)', line)
        if comment and not line.endswith(('of', 'good')) and 'mistakes_test' not in line and 'first hour' not in line:
            if names:
                yield title, names
            title, names = comment[1], []
        name = re.match(r'name = "(.*)"', line)
        if name:
            names.append(name[1])
    yield title, names


def cell(text):
    return text.replace('|', '\\|').replace('\n', ' ')


def rows_of(names, mistakes):
    for name in names:
        mistake = mistakes[name]
        said = [part for part in mistake['said'] if part != SILENT]
        if not said:
            continue
        if 'cure' not in mistake:
            raise SystemExit(f'mistakes.toml: {name}: ends with a message and has no cure, write one')
        yield f"| {cell(name)} | {' .. '.join('`' + cell(part.strip()) + '`' for part in said)} | {cell(mistake['cure'])} |"


def tables():
    text = (HERE / 'mistakes.toml').read_text()
    mistakes = {mistake['name']: mistake for mistake in tomllib.loads(text)['mistake']}
    out = []
    for title, names in sections(text):
        rows = list(rows_of(names, mistakes))
        if rows:
            out += [f'## {title}', '| what happened | what the program says | cure |', '|---|---|---|', *rows, '']
    return '\n'.join(out)


def main():
    page = PAGE.read_text()
    head = page.split(MARK)[0]
    new = head + MARK + '\n\n' + tables()
    if sys.argv[1:] == ['--update']:
        PAGE.write_text(new)
        return 0
    if new != page:
        print(f'{PAGE.name} is not what mistakes.toml says: run tests/mistakes/messages.py --update')
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
