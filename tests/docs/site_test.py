#!/usr/bin/env python3
"""site_test.py OUT: makes the site in OUT and looks at what came out: every page is there, every link and anchor within the site leads
somewhere, lists and tables are lists and tables."""
import html.parser
import pathlib
import subprocess
import sys
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / 'toolchains/site'))
from pages import ITEM, Page  # noqa: E402: after its path is known


class Html(html.parser.HTMLParser):
    def __init__(self, path):
        super().__init__()
        self.ids, self.links, self.counts, self.article, self.text = set(), [], {}, 0, ''
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if 'id' in attributes:
            self.ids.add(attributes['id'])
        if tag == 'a' and attributes.get('href'):
            self.links.append(attributes['href'])
        self.article += tag == 'article'
        if self.article:
            self.counts[tag] = self.counts.get(tag, 0) + 1

    def handle_data(self, data):
        self.text += data if self.article else ''

    def handle_endtag(self, tag):
        self.article -= tag == 'article'


def bad_links(site, pages):
    for path, page in pages.items():
        for link in page.links:
            parts = urllib.parse.urlsplit(link)
            if parts.scheme or link.startswith('//'):
                continue
            target = (path.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else path
            if target.is_dir():
                target = target / 'index.html'
            if not target.exists():
                yield f'{path.relative_to(site)}: {link}: no such page'
            elif parts.fragment and target in pages and urllib.parse.unquote(parts.fragment) not in pages[target].ids:
                yield f'{path.relative_to(site)}: {link}: no such heading'


def missing(site, pages):
    """Guides whose items or tables are text."""
    for source in sorted((ROOT / 'docs/guide').glob('*.md')):
        path = site / 'guide' / source.stem / 'index.html'
        if path not in pages:
            yield f'{source.name}: not on the site'
            continue
        page = Page(source, ROOT)
        items = sum(1 for _, line in page.prose if ITEM.match(line))
        tables = sum(1 for _, line in page.prose if line.startswith('|--'))
        counts = pages[path].counts
        if counts.get('li', 0) != items:
            yield f"{source.name}: {counts.get('li', 0)} of {items} items are items"
        if '```' in pages[path].text:
            yield f'{source.name}: a block of code is no block'
        if counts.get('table', 0) != tables:
            yield f"{source.name}: {counts.get('table', 0)} of {tables} tables are tables"


def main():
    out = pathlib.Path(sys.argv[1]).resolve()
    done = subprocess.run([ROOT / 'toolchains/site/site.py', out], capture_output=True, text=True)
    if done.returncode != 0:
        print(done.stdout, done.stderr)
        return 1
    site = out / 'html'
    pages = {path: Html(path) for path in site.rglob('*.html') if 'api' not in path.relative_to(site).parts and path.name != '404.html'}
    failures = [*bad_links(site, pages), *missing(site, pages)]
    if not (site / 'api/index.html').exists():
        failures.append('no reference of the headers')
    print('\n'.join(failures) or f'{len(pages)} pages')
    return 1 if failures else 0


if __name__ == '__main__':
    sys.exit(main())
