"""A real browser for the tests: what a page looks like once it is laid out."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

_NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")

# Rectangles of all visible text; two of them that lie on each other by more than a hair are text
# over text. The page's own policy forbids scripts, so the probe comes with a copy without it.
_PROBE = """
<script>
window.addEventListener("load", () => {
  const boxes = [];
  const folded = element => {  // what a closed <details> holds has a place, but is not shown
    const part = element.closest("details:not([open])");
    return part !== null && element.closest("summary") === null;
  };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    if (!node.data.trim() || node.parentElement.closest("script, svg")) continue;
    if (folded(node.parentElement)) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const r of range.getClientRects())
      if (r.width > 1 && r.height > 1) boxes.push([r, node.data.trim().slice(0, 40)]);
  }
  const images = [...document.querySelectorAll(".plot svg, .plot img")];
  const label = image => image.alt || image.getAttribute("aria-label");
  for (const image of images)
    if (!folded(image))
      boxes.push([image.getBoundingClientRect(), label(image)]);
  const overlaps = [];
  for (let i = 0; i < boxes.length; i++)
    for (let j = i + 1; j < boxes.length; j++) {
      const [a, b] = [boxes[i][0], boxes[j][0]];
      const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (wide > 2 && high > 3) overlaps.push([boxes[i][1], boxes[j][1]]);
    }
  const page = document.documentElement;
  const found = {
    texts: boxes.length,
    overlaps: overlaps,
    width: page.scrollWidth, window: page.clientWidth,
    height: page.scrollHeight,
    images: images.map(image => [
      label(image), image.naturalWidth || image.viewBox.baseVal.width,
      folded(image) ? 0 : image.getBoundingClientRect().width,
    ]),
    requests: performance.getEntriesByType("resource").map(entry => entry.name.slice(0, 60)),
  };
  const note = document.createElement("pre");
  note.id = "probe";
  note.textContent = JSON.stringify(found);
  document.body.append(note);
});
</script>
"""


def find_browser() -> str | None:
    return next((path for name in _NAMES if (path := shutil.which(name))), None)


def probe(page: Path, folder: Path, width: int) -> dict[str, Any]:
    """Open a copy of `page` in a window `width` pixels wide and measure it."""
    text = page.read_text(encoding="utf-8")
    text, policies = re.subn(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", text)
    assert policies == 1
    copy = folder / f"probe-{width}.html"
    copy.write_text(text.replace("</body>", _PROBE + "</body>"), encoding="utf-8")
    dumped = run(folder, f"--window-size={width},2000", "--dump-dom", copy.as_uri())
    found = re.search(r'<pre id="probe">(.*?)</pre>', dumped, re.DOTALL)
    assert found, dumped[-500:]
    return json.loads(html.unescape(found[1]))


def run(folder: Path, *arguments: str) -> str:
    browser = find_browser()
    assert browser is not None
    done = subprocess.run(
        [
            browser,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-sync",
            f"--user-data-dir={folder / 'profile'}",
            *arguments,
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return done.stdout


needs_browser = pytest.mark.skipif(
    find_browser() is None, reason=f"no browser here: looked for {', '.join(_NAMES)}"
)
