// Opens each report.html in a headless Chromium and says what is wrong with it, as JSON: errors of the console, requests that leave
// the file, text of the summary that is missing, violations of accessibility (axe-core), headings that skip a level, contents wider
// than the window, and how many pages it prints on. Screenshots at three widths, light and dark, go into a folder to be looked at.
//
//   NODE_PATH=TOOLS/node_modules node check.mjs CHROMIUM PICTURES (REPORT SUMMARY)...
//
// where TOOLS has puppeteer-core and axe-core, neither of which brings a browser along.
import { createRequire } from "node:module";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { basename, dirname, join } from "node:path";
import { pathToFileURL } from "node:url";

const require = createRequire(join(process.env.NODE_PATH, "tools.cjs"));
const puppeteer = await import(pathToFileURL(require.resolve("puppeteer-core")));
const axe = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");

const [chromium, pictures, ...files] = process.argv.slice(2);
const WIDTHS = [360, 800, 1280];
const plain = (text) => text.replace(/\s+/g, " ").trim();

async function check(browser, report, summary) {
  const wrong = [];
  const page = await browser.newPage();
  page.on("console", (message) => {
    if (["error", "warning", "warn"].includes(message.type())) wrong.push(`console: ${message.text()}`);
  });
  page.on("pageerror", (error) => wrong.push(`script: ${error}`));
  const own = pathToFileURL(report).href;
  page.on("request", (request) => {
    if (request.url() !== own && !request.url().startsWith("data:")) wrong.push(`request: ${request.url()}`);
  });
  await page.goto(own, { waitUntil: "load" });
  const shown = plain(await page.evaluate(() => document.body.innerText));
  for (const line of readFileSync(summary, "utf8").split("\n").map(plain)) {
    if (line && !shown.includes(line)) wrong.push(`not on the page: ${line}`);
  }
  const broken = await page.evaluate(() =>
    [...document.images].filter((one) => !one.complete || one.naturalWidth === 0).map((one) => one.alt));
  wrong.push(...broken.map((alt) => `figure that is not shown: ${alt}`));
  const levels = await page.evaluate(() => [...document.querySelectorAll("h1,h2,h3,h4,h5,h6")].map((one) => +one.tagName[1]));
  if (levels[0] !== 1 || levels.some((level, at) => at > 0 && level > levels[at - 1] + 1)) wrong.push(`headings: ${levels}`);
  const name = basename(dirname(report));
  for (const scheme of ["light", "dark"]) {
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
    for (const width of WIDTHS) {
      await page.setViewport({ width, height: 900 });
      const wide = await page.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
      if (wide > 0) wrong.push(`${scheme}, ${width} px: ${wide} px wider than the window`);
      await page.screenshot({ path: join(pictures, `${name}-${scheme}-${width}.png`), fullPage: true });
    }
    await page.evaluate(axe);
    const found = await page.evaluate(() => axe.run(document));
    for (const one of found.violations) {
      wrong.push(`axe, ${scheme}: ${one.id} (${one.impact}): ${one.nodes.map((node) => node.target).join(" | ")}`);
    }
    if (found.passes.length < 10) wrong.push(`axe, ${scheme}: only ${found.passes.length} rules were looked at`);
  }
  // A button that the script adds makes a figure wide.
  const wider = await page.evaluate(() => {
    const figure = document.querySelector("figure");
    figure?.querySelector("button")?.click();
    return !figure || figure.classList.contains("wide");
  });
  if (!wider) wrong.push("script: a figure does not become wide");
  const pdf = await page.pdf({ format: "A4", preferCSSPageSize: true });
  writeFileSync(join(pictures, `${name}.pdf`), pdf);
  // No figure is cut: in print each is lower than a page of A4 less its margins.
  await page.emulateMediaType("print");
  await page.setViewport({ width: 688, height: 1001 });
  const high = await page.evaluate(() =>
    [...document.querySelectorAll("figure")].filter((one) => one.getBoundingClientRect().height > 1001).map((one) => one.innerText));
  wrong.push(...high.map((text) => `higher than a page in print: ${text}`));
  await page.close();
  return { report, wrong };
}

mkdirSync(pictures, { recursive: true });
const browser = await puppeteer.launch({
  executablePath: chromium,
  args: ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run"],
});
const results = [];
for (let at = 0; at + 1 < files.length; at += 2) results.push(await check(browser, files[at], files[at + 1]));
await browser.close();
console.log(JSON.stringify(results, null, 1));
