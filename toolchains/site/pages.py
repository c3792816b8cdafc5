"""Pages in Markdown: their prose without code, headings with the anchors that GitHub gives them, links."""
import re

FENCE = re.compile(r'^\s*```')
ITEM = re.compile(r'^\s*(?:[-*]|\d+\.)\s+')
# A link, whose text may hold one pair of brackets, as `[[log]]`.
LINK = re.compile(r'!?\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+(?:\([^()]*\))?)\)')


class Page:
    """A page as blocks: (line, text) of each paragraph or item of a list, without headings, tables and code."""

    def __init__(self, path, root):
        self.path, self.name = path, str(path.relative_to(root))
        self.lines = path.read_text().split('\n')
        self.prose = list(self._without_code())

    def _without_code(self):
        fenced, blank, in_list = False, True, False
        for number, line in enumerate(self.lines, 1):
            if FENCE.match(line):
                fenced, blank = not fenced, False
                yield number, ''
                continue
            if ITEM.match(line):
                in_list = True
            elif line.strip() and not line.startswith(' ') and blank:
                in_list = False
            indented = line.startswith('    ') and not in_list and not ITEM.match(line)
            code = fenced or (indented and (blank or not self._prose_before(number)))
            yield number, '' if code else line
            blank = not line.strip()

    def _prose_before(self, number):
        before = self.lines[number - 2]
        return bool(before.strip()) and not before.startswith('    ')

    def blocks(self):
        start, block = 0, []
        for number, line in self.prose + [(0, '')]:
            aside = not line.strip() or line.startswith('#') or line.lstrip().startswith(('|', '<!--'))
            if (aside or ITEM.match(line)) and block:
                yield start, ' '.join(block)
                block = []
            if not aside:
                start = start if block else number
                block.append(ITEM.sub('', line).strip())

    def headings(self):
        return [line.lstrip('#').strip() for number, line in self.prose if re.match(r'#{1,6} ', line)]

    def anchors(self):
        """As GitHub makes them: lower case, no punctuation, spaces become hyphens, a second one counted."""
        seen, anchors = {}, set()
        for heading in self.headings():
            text = LINK.sub(r'\1', heading).replace('`', '')
            anchor = re.sub(r'[^\w\- ]', '', text.lower()).replace(' ', '-')
            count = seen.get(anchor, 0)
            seen[anchor] = count + 1
            anchors.add(anchor if count == 0 else f'{anchor}-{count}')
        return anchors

    def links(self):
        for number, line in self.prose:
            for match in LINK.finditer(re.sub(r'`[^`]*`(?!\])', lambda code: 'x' * len(code[0]), line)):
                yield number, match[2]
