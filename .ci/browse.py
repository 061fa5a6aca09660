"""Open reports and pages in headless Chromium: no error, all that is drawn is seen, controls work, nothing is cut off.

    python3 browse.py CHROMIUM --reports FILE.html ... --pages FILE.html ...

Needs Python alone: Chromium is asked through a pipe, in its DevTools protocol. A report has plots of plotly; other
pages are looked at for errors and equations that stand there as text.
"""

from __future__ import annotations

import argparse
import base64
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

OPTIONS = ("--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--disable-gpu-sandbox", "--use-gl=angle",
           "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run",
           "--disable-background-networking", "--allow-file-access-from-files", "--hide-scrollbars",
           "--host-resolver-rules=MAP * ~NOTFOUND")
NARROW, WIDE, A4 = 420, 1280, 718                    # widths, CSS pixels; A4 less margins of 1 cm
PATIENCE = 120.0                                     # s, for a page to be drawn

SPHINX = ("doctools.js", "sphinx_highlight.js", "searchtools.js", "Search is not defined")
"""Scripts of Sphinx for its search, which a Debian root without /usr/share/javascript does not have."""
THEME = "Gumshoe is not a constructor"                # Debian's furo imports this script wrongly

ASKED = Path(__file__).with_suffix(".js").read_text(encoding="utf-8")


class Chromium:
    """Chromium with one page."""

    def __init__(self, program: str):
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        commands, self._to = os.pipe()
        self._from, answers = os.pipe()
        words = [program, *OPTIONS, f"--user-data-dir={self._folder.name}", "about:blank"]
        self._process = subprocess.Popen(["sh", "-c", f'exec "$@" 3<&{commands} 4>&{answers}', "sh", *words],
                                         pass_fds=(commands, answers), stdout=subprocess.DEVNULL,
                                         stderr=subprocess.DEVNULL)
        os.close(commands)
        os.close(answers)
        self._number, self._rest, self.errors, self._session = 0, b"", [], ""
        targets = self.ask("Target.getTargets")["targetInfos"]
        page = next(target for target in targets if target["type"] == "page")
        self._session = self.ask("Target.attachToTarget", targetId=page["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.ask(f"{domain}.enable")

    def ask(self, method: str, **arguments: Any) -> dict[str, Any]:
        """Return the answer to a command; events that come before it are looked at for errors."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": arguments}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            answer = self._receive()
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return dict(answer["result"])
            self._look_at(answer)
        raise RuntimeError(f"{method}: no answer for {PATIENCE} s")

    def _receive(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            data = os.read(self._from, 1 << 20)
            if not data:
                raise RuntimeError("Chromium ended")
            self._rest += data
        message, self._rest = self._rest.split(b"\0", 1)
        return dict(json.loads(message))

    def _look_at(self, event: dict[str, Any]) -> None:
        given = event.get("params", {})
        if event.get("method") == "Runtime.exceptionThrown":
            details = given["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"]))
        if event.get("method") == "Runtime.consoleAPICalled" and given["type"] == "error":
            self.errors.append(str([one.get("value", one.get("description")) for one in given["args"]]))
        if event.get("method") == "Log.entryAdded" and given["entry"]["level"] == "error":
            self.errors.append(f"{given['entry']['text']} {given['entry'].get('url', '')}")

    def evaluate(self, script: str) -> Any:
        """Return the value of a script in the page; of a promise, its result."""
        found = self.ask("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in found:
            raise RuntimeError(str(found["exceptionDetails"].get("exception", {}).get("description")))
        return found["result"].get("value")

    def open(self, file: Path, width: int) -> None:
        """Open a file in a window of a width, and wait until it is drawn."""
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=width < 700)
        self.ask("Page.navigate", url=file.resolve().as_uri())
        time.sleep(0.5)
        self.evaluate(ASKED)
        self.evaluate(f"drawn({json.dumps(is_interactive(file))})")

    def close(self) -> None:
        """End Chromium."""
        self._process.kill()
        self._process.wait()
        self._folder.cleanup()


def is_interactive(file: Path) -> bool:
    """Return True if a page is a report whose plots can be turned."""
    return re.search(r"id=\"?(slider|charts)\b", file.read_text(encoding="utf-8")) is not None


def report_findings(browser: Chromium, file: Path) -> list[str]:
    """Return what is wrong with a report."""
    browser.open(file, WIDE)
    found = [f"width {WIDE}: {what}" for what in browser.evaluate("cut()")]
    if is_interactive(file):
        colours = browser.evaluate("colours()")
        if not colours or min(colours) < 1:
            found.append(f"a plot is empty: colours {colours}")
        found += browser.evaluate("gaps()")
        first = browser.evaluate("pictures()")
        if first:
            browser.evaluate("move()")
            moved = browser.evaluate("pictures()")
            found += ["the slider does not change a picture"] * any(a == b for a, b in zip(first, moved))
            if browser.evaluate("choose()") > 1:
                found += ["the menu of colours changes no picture"] * (browser.evaluate("pictures()") == moved)
    browser.open(file, NARROW)
    found += [f"width {NARROW}: {what}" for what in browser.evaluate("cut()")]
    browser.ask("Emulation.setEmulatedMedia", media="print")
    browser.open(file, A4)
    found += [f"on A4: {what}" for what in browser.evaluate("cut()")]
    browser.ask("Emulation.setEmulatedMedia", media="")
    pdf = base64.b64decode(browser.ask("Page.printToPDF", paperWidth=8.27, paperHeight=11.69,
                                       printBackground=True)["data"])
    return found + ["it cannot be printed"] * (len(pdf) < 10_000 or pdf[:4] != b"%PDF")


def page_findings(browser: Chromium, file: Path) -> list[str]:
    """Return what is wrong with a page of the documentation."""
    browser.open(file, WIDE)
    found = [f"an equation stands there as text: {text}" for text in browser.evaluate("texts()")]
    for link in dict.fromkeys(browser.evaluate("links()")):
        path = Path(unquote(urlparse(link).path))
        if not path.exists():
            found.append(f"dead link: {link}")
    static = next(folder / "_static" for folder in file.resolve().parents if (folder / "_static").is_dir())
    known = [THEME] if (static / "doctools.js").exists() else [THEME, *SPHINX]
    browser.errors[:] = [error for error in browser.errors if not any(word in error for word in known)]
    return found


def main() -> int:
    """Print the findings; 1 if there is one."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("chromium", help="command of Chromium")
    options.add_argument("--reports", nargs="*", type=Path, default=[], help="reports of formingx")
    options.add_argument("--pages", nargs="*", type=Path, default=[], help="built pages of the documentation")
    args = options.parse_args()
    browser, bad = Chromium(args.chromium), 0
    try:
        for look_at, files in ((report_findings, args.reports), (page_findings, args.pages)):
            for file in files:
                browser.errors.clear()
                found = [*look_at(browser, file), *(f"console: {error}" for error in browser.errors)]
                bad += len(found)
                if found or look_at is report_findings:
                    print(f"{file}: {len(found)} findings", *found, sep="\n  ", flush=True)
    finally:
        browser.close()
    print(f"{len(args.reports)} reports and {len(args.pages)} pages: {bad} findings")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
