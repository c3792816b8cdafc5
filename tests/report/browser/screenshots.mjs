// screenshots.mjs REPORT.html DIR: the page as people see it: desktop.png, dark.png (first screen at 1280 x 800), phone.png
// (390 px wide, the first 2000 px), paper.pdf. screenshots.sh calls it.
import {mkdirSync, writeFileSync} from 'node:fs';
import {join, resolve} from 'node:path';
import {pathToFileURL} from 'node:url';
import puppeteer from 'puppeteer-core';

if (process.argv.length !== 4) {
  console.error('usage: screenshots.mjs REPORT.html DIR');
  process.exit(2);
}
const directory = resolve(process.argv[3]);
mkdirSync(directory, {recursive: true});
const browser = await puppeteer.launch({executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium', headless: true,
  args: ['--disable-gpu', '--disable-dev-shm-usage', ...(process.getuid() === 0 ? ['--no-sandbox'] : [])]});
try {
  const page = await browser.newPage();
  await page.goto(pathToFileURL(resolve(process.argv[2])).href);
  for (const [name, scheme, width, height] of
    [['desktop', 'light', 1280, 800], ['dark', 'dark', 1280, 800], ['phone', 'light', 390, 2000]]) {
    await page.emulateMediaFeatures([{name: 'prefers-color-scheme', value: scheme}]);
    await page.setViewport({width, height});
    await page.screenshot({path: join(directory, `${name}.png`)});
  }
  writeFileSync(join(directory, 'paper.pdf'), await page.pdf({preferCSSPageSize: true, printBackground: true}));
} finally {
  await browser.close();
}
