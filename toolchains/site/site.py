#!/usr/bin/env python3
"""site.py OUT: makes the site of the guides in OUT/html, with Debian's mkdocs (material theme) and Doxygen.

The pages are staged in OUT/pages: README.md is the start page, the rest keeps its place below docs. A link to a page or picture is
kept. A link to a file of the code becomes plain text, since the site has no code. A link that leads nowhere is an error.
"""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

from pages import FENCE, ITEM, LINK, Page

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = pathlib.Path(__file__).resolve().parent


def site_paths():
    """Path in the tree -> path in the site."""
    paths = {'README.md': 'index.md', 'docs/README.md': 'contents.md'}
    for path in [*ROOT.glob('*.md'), *(ROOT / 'docs').rglob('*.*')]:
        name = str(path.relative_to(ROOT))
        paths.setdefault(name, name.removeprefix('docs/'))
    return paths


def staged(page, paths):
    """The page's text with links as the site has them."""
    here = pathlib.PurePosixPath(paths[page.name]).parent

    def relink(match):
        text, target = match[1], match[2]
        file, mark, anchor = target.partition('#')
        if re.match(r'[a-z]+:', target) or not file:
            return match[0]
        path = (page.path.parent / file).resolve()
        if not path.exists():
            raise SystemExit(f'{page.name}: {target}: no such file, correct the link')
        name = str(path.relative_to(ROOT))
        if name == 'docs/findings':
            name = 'docs/findings/index.md'
        if name not in paths:
            return text
        return f'{"!" if match[0].startswith("!") else ""}[{text}]({os.path.relpath(paths[name], here)}{mark}{anchor})'

    prose = dict(page.prose)
    return '\n'.join(spaced([LINK.sub(relink, line) if prose.get(number) else line for number, line in enumerate(page.lines, 1)]))


def spaced(lines):
    """As Python's Markdown wants it, where GitHub is content with less: a blank line in front of lists and tables, four spaces within an
    item."""
    shift, before, fenced = 0, '', False
    for line in lines:
        item = None if fenced else ITEM.match(line)
        if not fenced:
            if item and not line.startswith(' '):
                if before.strip() and not ITEM.match(before) and not before.startswith(' '):
                    yield ''
                shift = 4 - len(item[0])
            elif line.strip() and not line.startswith(' ') and not before.strip():
                shift = 0
            if line.startswith('|') and before.strip() and not before.startswith('|'):
                yield ''
        if FENCE.match(line):
            fenced = not fenced
        yield ' ' * shift + line if line.startswith('  ') and shift > 0 else line
        before = line


def stage(out):
    paths = site_paths()
    paths['docs/findings/index.md'] = 'findings/index.md'
    findings = []
    for name, target in paths.items():
        source, copy = ROOT / name, out / target
        copy.parent.mkdir(parents=True, exist_ok=True)
        if name == 'docs/findings/index.md':
            continue
        if source.suffix != '.md':
            shutil.copy(source, copy)
            continue
        page = Page(source, ROOT)
        copy.write_text(staged(page, paths))
        if name.startswith('docs/findings/'):
            findings.append(f'- [{page.headings()[0]}]({source.name})')
    (out / 'findings/index.md').write_text('# Findings\n\n' + '\n'.join(sorted(findings)) + '\n')
    contents = out / 'contents.md'
    contents.write_text(contents.read_text() + '\n## Reference\n[Headers of the model](api/index.html), by Doxygen.\n')
    return paths


def navigation(paths):
    """The parts of docs/README.md with their pages, then the findings."""
    page = Page(ROOT / 'docs/README.md', ROOT)
    parts = [{'fxdyn': ['index.md', 'contents.md']}]
    for _, line in page.prose:
        if line.startswith('## '):
            parts.append({line[3:]: []})
        pages = next(iter(parts[-1].values()))
        for match in LINK.finditer(line):
            path = (page.path.parent / match[2].partition('#')[0]).resolve()
            name = paths.get(str(path.relative_to(ROOT)))
            if name and name.endswith('.md') and name not in pages:
                pages.append(name)
    listed = {name for part in parts for pages in part.values() for name in pages}
    others = sorted(name for name in paths.values() if name.endswith('.md') and name not in listed)
    parts += [{'Findings': [name for name in others if name.startswith('findings/')]},
              {'Project': [name for name in others if not name.startswith('findings/')]}]
    return [part for part in parts if next(iter(part.values()))]


def main():
    if len(sys.argv) != 2:
        print(__doc__)
        return 2
    out = pathlib.Path(sys.argv[1]).resolve()
    shutil.rmtree(out, ignore_errors=True)
    pages = out / 'pages'
    paths = stage(pages)
    settings = (HERE / 'Doxyfile').read_text() + f'\nOUTPUT_DIRECTORY = {pages}\n'
    subprocess.run(['doxygen', '-'], input=settings, text=True, check=True, cwd=ROOT)
    nav = json.dumps(navigation(paths))  # JSON is YAML, too
    (out / 'mkdocs.yml').write_text((HERE / 'mkdocs.yml').read_text() + f'docs_dir: {pages}\nsite_dir: {out}/html\nnav: {nav}\n')
    subprocess.run(['mkdocs', 'build', '--strict', '--quiet', '--config-file', str(out / 'mkdocs.yml')], check=True)
    print(out / 'html/index.html')
    return 0


if __name__ == '__main__':
    sys.exit(main())
