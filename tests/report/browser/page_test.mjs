// page_test.mjs DIR: opens DIR/*.html in headless Chromium and checks what a reader of report.html is promised.
// DIR/limits.json says of a page by its name: {"joints": n, "first_screen": bool}. One line a failure; exit code 1.
import {readFileSync, readdirSync} from 'node:fs';
import {createRequire} from 'node:module';
import {join, resolve} from 'node:path';
import {pathToFileURL} from 'node:url';
import puppeteer from 'puppeteer-core';

const axe = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
const desktop = {width: 1280, height: 800};
const phone = {width: 390, height: 844};
const paper = {width: 703, height: 1031};  // A4 less margins of 12 mm, at 96 px an inch
const mostPages = 12;
const leastContrast = 4.5;  // WCAG 2.1, 1.4.3

const failures = [];
const check = (ok, what) => ok || failures.push(what);

/// In the page: what stands beyond the viewport's right edge, scroll frames' content apart.
function beyondTheEdge() {
  const inFrame = (element) => {
    const frame = element.closest('.scroll');
    return frame && frame !== element && getComputedStyle(frame).overflowX === 'auto';
  };
  const wide = [...document.body.querySelectorAll('*')].filter((element) => {
    const box = element.getBoundingClientRect();
    return box.width > 1 && box.right > innerWidth + 1 && !inFrame(element) && !element.closest('.skip');
  });
  return {page: document.scrollingElement.scrollWidth, shown: innerWidth,
    wide: wide.slice(0, 3).map((e) => `<${e.tagName.toLowerCase()}> ${e.textContent.trim().slice(0, 40)}`)};
}

/// In the page: the least contrast of text that axe does not look at, as in "disc bad 5.2".
function leastOf() {
  const canvas = document.createElement('canvas').getContext('2d', {willReadFrequently: true});
  const light = (colour) => {
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    const part = [...canvas.getImageData(0, 0, 1, 1).data].slice(0, 3).map((byte) => {
      const c = byte / 255;
      return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * part[0] + 0.7152 * part[1] + 0.0722 * part[2];
  };
  const contrast = (a, b) => {
    const [low, high] = [light(a), light(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };
  const behind = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const colour = getComputedStyle(e).backgroundColor;
      if (colour !== 'rgba(0, 0, 0, 0)' && colour !== 'transparent') return colour;
    }
    return 'white';
  };
  const all = [];
  for (const disc of document.querySelectorAll('.disc')) {
    const colour = getComputedStyle(disc.querySelector('text')).fill;
    all.push({what: disc.getAttribute('class'), value: contrast(colour, getComputedStyle(disc.firstElementChild.nextElementSibling).fill)});
  }
  for (const cell of document.querySelectorAll('td')) {
    const label = getComputedStyle(cell, '::before');
    if (label.content === 'none') continue;
    all.push({what: `label of ${cell.className}`, value: contrast(label.color, behind(cell))});
  }
  return all.sort((a, b) => a.value - b.value)[0] ?? {what: 'nothing', value: 99};
}

async function checkAxe(page, name) {
  const found = await page.evaluate(`${axe}; axe.run(document, {resultTypes: ['violations']})`);
  for (const rule of found.violations.filter((v) => ['serious', 'critical'].includes(v.impact)))
    failures.push(`${name}: axe ${rule.id}: ${rule.help}: ${rule.nodes[0].html.slice(0, 120)}`);
  check(found.passes.length > 10, `${name}: axe looked at ${found.passes.length} rules only`);
}

/// Pixels of an element's own colours, not the paper's: those that are neither white nor grey.
async function paintedPixels(element, blank) {
  const picture = await element.screenshot({encoding: 'base64'});
  return blank.evaluate(async (data) => {
    const image = new Image();
    image.src = `data:image/png;base64,${data}`;
    await image.decode();
    const canvas = new OffscreenCanvas(image.width, image.height).getContext('2d');
    canvas.drawImage(image, 0, 0);
    const bytes = canvas.getImageData(0, 0, image.width, image.height).data;
    let count = 0;
    for (let k = 0; k < bytes.length; k += 4)
      if (Math.max(bytes[k], bytes[k + 1], bytes[k + 2]) - Math.min(bytes[k], bytes[k + 1], bytes[k + 2]) > 60) ++count;
    return count;
  }, picture);
}

async function checkPlots(page, blank, name) {
  const plots = await page.$$('figure:not(.on) > svg.plot');
  check(plots.length > 0, `${name}: no plot`);
  for (const [i, plot] of plots.entries()) {
    const painted = await paintedPixels(plot, blank);
    check(painted > 100, `${name}: plot ${i + 1} has ${painted} painted pixels`);
  }
}

/// In the page: the least and the largest time of each panel of the first live plot, and its readout.
function shownTimes() {
  const {live} = document.querySelector('figure.live');
  return {ends: live.plots.map((u) => [u.scales.x.min, u.scales.x.max]), words: live.readout.textContent};
}

/// Torque and residual, velocity and position are drawn, and follow one zoom and one cursor.
async function checkLivePlots(page, blank, name, expected) {
  const figures = await page.$$('figure.live');
  check(figures.length === expected, `${name}: ${figures.length} live plots, ${expected} expected (built without npm?)`);
  if (figures.length === 0) return;
  for (const [i, figure] of figures.entries()) {
    await figure.scrollIntoView();
    const made = await page.waitForFunction((f) => f.live?.plots.length === 4, {timeout: 5000}, figure).catch(() => null);
    check(made, `${name}: live plot ${i + 1} is not there`);
    const painted = made ? await paintedPixels(await figure.$('.live-plot'), blank) : 0;
    check(painted > 500, `${name}: live plot ${i + 1} has ${painted} painted pixels`);
    check(await figure.$eval('svg.plot', (e) => getComputedStyle(e).display === 'none'), `${name}: picture ${i + 1} stays beside its live plot`);
  }
  await figures[0].scrollIntoView();
  const panels = await figures[0].$$('.u-over');
  const before = await page.evaluate(shownTimes);
  const box = await panels[1].boundingBox();
  await page.mouse.move(box.x + 0.25 * box.width, box.y + 20);
  await page.mouse.down();
  await page.mouse.move(box.x + 0.5 * box.width, box.y + 20, {steps: 5});
  await page.mouse.up();
  const zoomed = await page.evaluate(shownTimes);
  const span = before.ends[0][1] - before.ends[0][0];
  for (const [from, to] of zoomed.ends)
    check(Math.abs(to - from - span / 4) < span / 50, `${name}: a quarter was dragged, shown are ${from} .. ${to} s of ${span} s`);
  check(/^[\d.]+ s.*measured -?[\d.e-]+ N.*residual.*velocity.*position/.test(zoomed.words), `${name}: the cursor reads "${zoomed.words}"`);
  await figures[0].$eval('.live-plot', (e) => e.focus());
  await page.keyboard.press('ArrowRight');
  const moved = await page.evaluate(shownTimes);
  check(moved.words !== zoomed.words, `${name}: the arrow key does not move the cursor`);
  await page.keyboard.press('0');
  const all = await page.evaluate(shownTimes);
  check(JSON.stringify(all.ends) === JSON.stringify(before.ends), `${name}: 0 shows ${JSON.stringify(all.ends)} instead of all`);
  await page.evaluate(() => scrollTo(0, 0));
}

/// The same page where scripts are not allowed: its pictures are all there.
async function checkWithoutScripts(browser, url, name) {
  const page = await browser.newPage();
  await page.setJavaScriptEnabled(false);
  await page.setViewport(desktop);
  await page.goto(url);
  const hidden = await page.$$eval('svg.plot', (all) => all.filter((e) => e.getBoundingClientRect().height < 50).length);
  const plots = await page.$$('svg.plot');
  check(plots.length > 0 && hidden === 0, `${name}: without scripts ${hidden} of ${plots.length} pictures are hidden`);
  await page.close();
}

async function checkFirstScreen(page, name, joints) {
  await page.setViewport(desktop);
  const answers = [...Array(joints).keys()].map((j) => `#joint-${j + 1}`).concat('h1', 'h2.first', '#drive', joints > 1 ? '.sketch' : '.overview figure');
  for (const answer of answers) {
    const at = await page.$eval(answer, (e) => ({bottom: e.getBoundingClientRect().bottom, words: e.textContent.trim()})).catch(() => null);
    check(at && at.words.length > 3, `${name}: ${answer} is not there or empty`);
    if (at) check(at.bottom <= desktop.height, `${name}: ${answer} ends at ${Math.round(at.bottom)} px, below the first screen`);
  }
}

/// Live plots follow the page's width a frame later.
const drawn = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 0)))));

async function checkPhone(page, name) {
  await page.setViewport(phone);
  await drawn(page);
  const edge = await page.evaluate(beyondTheEdge);
  check(edge.page <= phone.width && edge.shown === phone.width, `${name}: ${edge.page} px wide at ${phone.width} px`);
  check(edge.wide.length === 0, `${name}: beyond the edge at ${phone.width} px: ${edge.wide.join('; ')}`);
  const least = await page.evaluate(leastOf);
  check(least.value >= leastContrast, `${name}: contrast ${least.value.toFixed(2)} of ${least.what}`);
}

async function checkPaper(page, name) {
  await page.setViewport(paper);
  await page.emulateMediaType('print');
  const edge = await page.evaluate(beyondTheEdge);
  check(edge.wide.length === 0, `${name}: cut on paper: ${edge.wide.join('; ')}`);
  const pdf = Buffer.from(await page.pdf({preferCSSPageSize: true, printBackground: true})).toString('latin1');
  const pages = (pdf.match(/\/Type\s*\/Page\b/g) ?? []).length;
  check(pages >= 1 && pages <= mostPages, `${name}: ${pages} pages on paper, at most ${mostPages}`);
  await page.emulateMediaType('screen');
  return pages;
}

async function checkKeyboard(page, name) {
  await page.keyboard.press('Tab');
  const first = await page.evaluate(() => ({skip: document.activeElement.matches('.skip'), left: document.activeElement.getBoundingClientRect().left}));
  check(first.skip && first.left >= 0, `${name}: the first stop of the Tab key is no visible skip link`);
  await page.keyboard.press('Enter');
  const arrived = await page.waitForFunction(() => location.hash === '#main', {timeout: 5000}).catch(() => null);
  check(arrived, `${name}: the skip link does not lead to the content`);
}

async function checkStructure(page, name) {
  const wrong = await page.evaluate(() => ({
    headers: document.querySelectorAll('th:not([scope])').length,
    tables: [...document.querySelectorAll('table')].filter((t) => !t.caption || !t.tHead).length,
    pictures: [...document.querySelectorAll('svg')].filter((s) => s.firstElementChild?.tagName !== 'title').length,
    links: [...document.querySelectorAll('nav a')].filter((a) => !document.querySelector(a.hash)).length,
    contents: document.querySelectorAll('nav a').length,
  }));
  check(wrong.headers === 0, `${name}: ${wrong.headers} headers without scope`);
  check(wrong.tables === 0, `${name}: ${wrong.tables} tables without caption or head`);
  check(wrong.pictures === 0, `${name}: ${wrong.pictures} graphics without title`);
  check(wrong.links === 0 && wrong.contents > 3, `${name}: contents: ${wrong.links} of ${wrong.contents} links lead nowhere`);
}

async function checkPage(browser, blank, directory, file, expected) {
  const name = file.replace(/\.html$/, '');
  const page = await browser.newPage();
  const url = pathToFileURL(join(directory, file)).href;
  page.on('console', (message) => ['error', 'warn'].includes(message.type()) && failures.push(`${name}: console: ${message.text()}`));
  page.on('pageerror', (error) => failures.push(`${name}: ${error.message}`));
  page.on('request', (request) => check(request.url() === url || request.url().startsWith('data:'), `${name}: asks for ${request.url()}`));
  await page.setViewport(desktop);
  await page.goto(url);
  await checkKeyboard(page, name);
  await checkStructure(page, name);
  if (expected.first_screen) await checkFirstScreen(page, name, expected.joints);
  if (expected.plots) {
    await checkLivePlots(page, blank, name, expected.live);
    await checkPlots(page, blank, name);
    await checkWithoutScripts(browser, url, name);
  }
  const start = Date.now();
  let pages = 0;
  for (const scheme of ['light', 'dark']) {
    await page.emulateMediaFeatures([{name: 'prefers-color-scheme', value: scheme}]);
    await page.setViewport(desktop);
    await checkAxe(page, `${name}, ${scheme}`);
    await checkPhone(page, `${name}, ${scheme}`);
    if (scheme === 'light') pages = await checkPaper(page, name);
  }
  await page.close();
  console.log(`${name}: ${pages} pages on paper, ${((Date.now() - start) / 1000).toFixed(1)} s`);
}

const directory = resolve(process.argv[2]);
const expected = JSON.parse(readFileSync(join(directory, 'limits.json'), 'utf8'));
const browser = await puppeteer.launch({executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium', headless: true,
  args: ['--disable-gpu', '--disable-dev-shm-usage', ...(process.getuid() === 0 ? ['--no-sandbox'] : [])]});
try {
  const blank = await browser.newPage();
  const files = readdirSync(directory).filter((file) => file.endsWith('.html')).sort();
  check(files.length === Object.keys(expected).length, `${files.length} pages, ${Object.keys(expected).length} expected`);
  for (const file of files) await checkPage(browser, blank, directory, file, expected[file.replace(/\.html$/, '')] ?? {});
} finally {
  await browser.close();
}
for (const failure of failures) console.error(failure);
process.exit(failures.length > 0 ? 1 : 0);
