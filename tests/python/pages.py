"""Opens pages in a browser, in the widths and themes that readers have, and prints what is wrong:
`pages.py BROWSERS SCREENSHOTS page.html...`.

The browser is that of the system; where there is none, one is fetched into the folder BROWSERS, without root: the one
of Playwright, or that of npm's `@sparticuz/chromium`. Where neither can be had, it prints `no browser`. What is looked for: errors on the console, requests, figures that draw nothing, text
below 11 px, and what sticks out of the page.
"""

import os
import pathlib
import shutil
import subprocess
import sys
import tarfile

from playwright._impl._driver import compute_driver_executable
from playwright.sync_api import Error, sync_playwright

INSTALLED = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome-headless-shell"]
PACKAGE = "@sparticuz/chromium@147.0.0"
WIDTHS = [390, 800, 1400]
LEAST = 11  # [px]

CHECK = """
least => {
  const wrong = [];
  const shown = element => element.getClientRects().length > 0;
  for (const element of document.querySelectorAll("body *")) {
    const own = [...element.childNodes].some(node => node.nodeType === 3 && node.data.trim());
    const size = parseFloat(getComputedStyle(element).fontSize);
    if (own && shown(element) && size < least && !element.closest("sup, sub")) wrong.push(`text of ${size} px: ${element.textContent.slice(0, 40)}`);
  }
  const width = document.documentElement.clientWidth;
  if (document.documentElement.scrollWidth > width) wrong.push(`the page is ${document.documentElement.scrollWidth} px wide`);
  for (const element of document.querySelectorAll("main *")) {
    const { right, left } = element.getBoundingClientRect();
    if (shown(element) && !element.closest(".scroll, .formula, .u-over, .u-wrap") && (right > width + 1 || left < -1))
      wrong.push(`${element.tagName}.${element.className} ends at ${right} of ${width}`);
  }
  const asked = document.querySelectorAll("figure > script").length;
  const drawn = document.querySelectorAll("figure:has(canvas)").length;
  if (asked !== drawn || asked === 0) wrong.push(`${drawn} of ${asked} figures are drawn`);
  for (const plot of window.figures) {
    const { width, height } = plot.ctx.canvas;
    const pixels = plot.ctx.getImageData(0, 0, width, height).data;
    const colours = new Set();
    for (let k = 0; k < pixels.length; k += 4) if (pixels[k + 3]) colours.add(pixels[k] << 16 | pixels[k + 1] << 8 | pixels[k + 2]);
    if (colours.size < 3) wrong.push(`${plot.root.ariaLabel}: an empty canvas`);
    for (const axis of plot.axes) if (axis.font[1] / devicePixelRatio < least) wrong.push(`ticks of ${axis.font[1]} px`);
  }
  return wrong;
}
"""

# A run is chosen, the pointer put on a figure, a part zoomed: all of it must work, and be undone.
USE = """
() => {
  const wrong = [];
  const select = document.querySelector("#choice select");
  if (select) {
    const count = () => window.figures[0].series.filter(own => own.show).length;
    const all = count();
    select.selectedIndex = 1;
    select.onchange();
    if (count() >= all) wrong.push("one run is as many as all");
    select.selectedIndex = 0;
    select.onchange();
    if (count() !== all) wrong.push("the other runs do not come back");
  }
  return wrong;
}
"""


def of_playwright(folder, environment):
    """The browser that Playwright downloads; none where its server cannot be reached."""
    install = [sys.executable, "-m", "playwright", "install", "chromium-headless-shell"]
    subprocess.run(install, env=environment, capture_output=True, timeout=300, check=False)
    return next(folder.glob("chromium_headless_shell-*/*/*headless*shell"), None)


def of_npm(folder):
    """The browser that npm has for servers, for Linux on x86-64 alone; its file is compressed with Brotli."""
    npm = shutil.which("npm")
    if npm is None or sys.platform != "linux" or os.uname().machine != "x86_64":
        return None
    fetched = subprocess.run([npm, "pack", "--silent", PACKAGE], cwd=folder, capture_output=True, timeout=300, check=False)
    archive = next(folder.glob("*.tgz"), None)
    if fetched.returncode != 0 or archive is None:
        return None
    with tarfile.open(archive) as files:
        compressed = files.extractfile("package/bin/chromium.br").read()
    (folder / "chromium.br").write_bytes(compressed)
    unpack = "const fs = require('fs'); fs.writeFileSync('part', require('zlib').brotliDecompressSync(fs.readFileSync('chromium.br')))"
    subprocess.run([compute_driver_executable()[0], "-e", unpack], cwd=folder, check=True)
    (folder / "part").chmod(0o755)
    for leftover in (archive, folder / "chromium.br"):
        leftover.unlink()
    return (folder / "part").rename(folder / "chromium")


def found(folder):
    """A browser's program; none where there is none."""
    installed = next(filter(None, map(shutil.which, INSTALLED)), None)
    fetched = next((own for own in [folder / "chromium"] if own.exists()), None)
    if installed or fetched:
        return installed or fetched
    folder.mkdir(parents=True, exist_ok=True)
    return of_playwright(folder, os.environ | {"PLAYWRIGHT_BROWSERS_PATH": str(folder)}) or of_npm(folder)


def launched(chromium, browser):
    """The browser, started. It may crash while it starts (once in some thirty times), which no page has a part in."""
    flags = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
    try:
        return chromium.launch(executable_path=browser, args=flags)
    except Error as error:
        if "SIGSEGV" not in str(error):
            raise
        print(error, file=sys.stderr)
        return chromium.launch(executable_path=browser, args=flags)


def looked_at(browser, page, folder, width, theme):
    """What is wrong with a page in that width and theme."""
    context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=theme)
    tab, wrong = context.new_page(), []
    tab.on("console", lambda message: message.type in ("error", "warning") and wrong.append(message.text))
    tab.on("pageerror", lambda error: wrong.append(str(error)))
    tab.on("request", lambda request: request.url.startswith("file:") or wrong.append(f"asks for {request.url}"))
    tab.goto(page.resolve().as_uri())
    tab.wait_for_timeout(150)
    wrong += tab.evaluate(CHECK, LEAST) + tab.evaluate(USE)
    place = tab.query_selector(".u-over")
    place.scroll_into_view_if_needed()
    box = place.bounding_box()
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    tab.mouse.move(*middle)
    before = tab.evaluate("window.figures[0].scales.x.max")
    tab.mouse.down()
    tab.mouse.move(middle[0] + 60, middle[1] + 2, steps=3)
    tab.mouse.up()
    tab.wait_for_timeout(50)
    if not tab.evaluate("window.figures[0].scales.x.max") < before:
        wrong.append("a drag does not zoom")
    tab.click(".reset:visible")
    tab.wait_for_timeout(50)
    if tab.evaluate("window.figures[0].scales.x.max") != before:
        wrong.append("all is not shown again")
    tab.screenshot(path=folder / f"{page.stem}-{width}-{theme}.png", full_page=True)
    context.close()
    return [f"{page.name}, {width} px, {theme}: {own}" for own in wrong]


def main():
    browsers, folder, *pages = map(pathlib.Path, sys.argv[1:])
    browser = found(browsers)
    if browser is None:
        print("no browser")
        return
    with sync_playwright() as playwright:
        opened = launched(playwright.chromium, browser)
        for page in pages:
            for width in WIDTHS:
                for theme in ("light", "dark"):
                    for wrong in looked_at(opened, page, folder, width, theme):
                        print(wrong)
        opened.close()


if __name__ == "__main__":
    main()
