#!/usr/bin/env python3
"""docs.py words | links | spelling: what every page for users looks like.

words     sentences of at most 25 words in README.md, CONTRIBUTING.md, docs/README.md and docs/guide, phrases that nobody understood,
          decisions of at most 400 words
links     every relative link and anchor of every page leads somewhere, and every page of docs has a link to it
spelling  aspell, British English, on the pages that `words` reads; terms.txt has the field's words
Headings, tables, formulas and code are aside. One line a complaint; exit code 1 where there is one.
"""
import argparse
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / 'toolchains/site'))
from pages import LINK, Page  # noqa: E402: after its path is known

MOST_OF_A_DECISION = 400  # words: one page that is read to its end
MOST_WORDS = 25  # of a sentence; what technical writing for second-language readers asks for

# Phrases of a vocabulary that only their author knew.
BANNED = (
    'four times differentiated',
    'may be 1 although',
    'what only the test logs show on top',
    'have taught that background',
    'alone says nothing here',
    'so is a constant half',
)

# The end of a sentence: not after an abbreviation, and a new one begins with a capital, a figure, code or a bracket.
END = re.compile(r'(?<!\bEq\.)(?<!\bEqs\.)(?<!\bFig\.)(?<!\bvs\.)(?<=[.?!])[)*_"]*\s+(?=[A-Z0-9`\[("*_-])')


def plain(text):
    """Text as it is read: a link is its text, code is one word."""
    return LINK.sub(r'\1', re.sub(r'`[^`]*`', 'Code', text))


def sentences(text):
    return [sentence for sentence in END.split(plain(text)) if sentence.strip()]


def words(sentence):
    return [word for word in sentence.split() if re.search(r'\w', word)]


def user_pages(root):
    paths = [root / 'README.md', root / 'CONTRIBUTING.md', root / 'docs/README.md', *sorted((root / 'docs/guide').glob('*.md'))]
    return [Page(path, root) for path in paths if path.exists()]


def all_pages(root):
    return [Page(path, root) for path in [*sorted(root.glob('*.md')), *sorted((root / 'docs').rglob('*.md'))]]


def check_words(root):
    for page in user_pages(root):
        for line, text in page.blocks():
            for sentence in sentences(text):
                count = len(words(sentence))
                if count > MOST_WORDS:
                    yield f'{page.name}:{line}: {count} words, say it in two sentences: "{" ".join(words(sentence)[:8])} .."'
        text = ' '.join('\n'.join(page.lines).split())
        for phrase in BANNED:
            if phrase in text:
                yield f'{page.name}: "{phrase}", say what it means'
    for path in sorted((root / 'docs/decisions').glob('*.md')):
        page = Page(path, root)
        count = sum(len(words(plain(text))) for line, text in page.blocks())
        if count > MOST_OF_A_DECISION:
            yield f'{page.name}: {count} words, at most {MOST_OF_A_DECISION}: history goes to docs/findings'


def check_links(root):
    pages = {page.path.resolve(): page for page in all_pages(root)}
    linked = {(root / 'README.md').resolve()}
    for page in pages.values():
        for line, target in page.links():
            if re.match(r'[a-z]+:', target):
                continue
            file, _, anchor = target.partition('#')
            path = (page.path.parent / file).resolve() if file else page.path.resolve()
            if not path.exists():
                yield f'{page.name}:{line}: {target}: no such file, correct the link'
                continue
            if path != page.path.resolve():
                linked.add(path)
            if anchor and path in pages and anchor not in pages[path].anchors():
                yield f'{page.name}:{line}: {target}: no such heading, correct the anchor'
    for path, page in pages.items():
        in_a_linked_folder = page.name.startswith('docs/findings/') and path.parent in linked
        special = page.name in ('CHANGELOG.md', 'SECURITY.md')  # GitHub shows these by itself
        if path not in linked and not in_a_linked_folder and not special:
            yield f'{page.name}: no page has a link to it, add it to docs/README.md'


def check_spelling(root):
    terms = pathlib.Path(__file__).with_name('terms.txt').read_text().split()
    known = {term.lower() for term in terms}
    for page in user_pages(root):
        found = {}
        for number, line in page.prose:
            bare = re.sub(r'`[^`]*`|<[^>]*>|\b\w+://\S+', ' ', LINK.sub(r'\1', re.sub(r'`[^`]*`', ' ', line)))
            # What holds a digit, an underscore, a point, a slash or a second capital is a name or a formula.
            for word in re.findall(r"(?<![\w./^~-])[A-Za-z][a-z']+(?![\w/^(]|\.\w)", bare):
                found.setdefault(word.strip("'"), number)
        run = subprocess.run(['aspell', '--lang=en_GB', '--ignore=2', 'list'], input='\n'.join(found), capture_output=True, text=True)
        if run.returncode != 0:
            yield f'aspell: {run.stderr.strip()}; install aspell and aspell-en (toolchains/setup.sh)'
            return
        for word in sorted(set(run.stdout.split())):
            if word.lower() not in known:
                yield f'{page.name}:{found.get(word, 0)}: "{word}" is not spelled so; a term goes into tests/docs/terms.txt'


CHECKS = {'words': check_words, 'links': check_links, 'spelling': check_spelling}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('check', choices=CHECKS)
    parser.add_argument('--root', type=pathlib.Path, default=ROOT, help='the tree (default: this one)')
    options = parser.parse_args()
    complaints = list(CHECKS[options.check](options.root.resolve()))
    for complaint in complaints:
        print(complaint)
    return 1 if complaints else 0


if __name__ == '__main__':
    sys.exit(main())
