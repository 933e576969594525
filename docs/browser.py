"""A page in a headless chromium, driven through its pipe by the DevTools protocol: no package is needed for it."""

from __future__ import annotations

import base64
import contextlib
import json
import os
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

BROWSER = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), ""
)
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--remote-debugging-pipe",
]
PHONE = 390
WIDE = 1400
"""Widths of a screen, px."""
_CUT_OFF = """[...document.querySelectorAll('main *')].filter(e => {
  if (!e.innerText || e.closest('table, pre, nav, dialog, .table, .formula, .highlight, .bd-sidebar')) return false;
  const r = e.getBoundingClientRect();
  return r.width > 0 && getComputedStyle(e).visibility != 'hidden' && r.right > innerWidth + 1;
}).slice(0, 3).map(e => e.tagName + '.' + e.className + ': ' + e.innerText.slice(0, 30)).join(' | ')"""
"""Text that ends beyond the screen, but for tables, code and formulas, which scroll within themselves."""
_WIDE = """[...document.querySelectorAll('body *')].filter(e => e.getBoundingClientRect().right > innerWidth + 1)
  .slice(0, 3).map(e => e.tagName + '.' + e.className).join(' ')"""
_BROKEN = """Promise.all([...document.images].map(i => {
  i.loading = 'eager';
  return i.decode().then(() => '', () => i.getAttribute('src'));
})).then(all => all.filter(Boolean).join(' '))"""
"""Images that cannot be drawn, those included that a page loads once they are scrolled to."""


class BrowserPage:
    """One page of a browser that is driven through its pipe by the DevTools protocol."""

    def __init__(self, profile: Path) -> None:
        to_browser, our_end = os.pipe()
        self._from, from_browser = os.pipe()
        # The protocol speaks through descriptors 3 and 4, whatever ours are called.
        wire = 'exec "$@" 3<&' + str(to_browser) + " 4>&" + str(from_browser)
        self._process = subprocess.Popen(
            ["bash", "-c", wire, "bash", BROWSER, *FLAGS, f"--user-data-dir={profile}", "about:blank"],
            pass_fds=(to_browser, from_browser),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        self._to = os.fdopen(our_end, "wb", buffering=0)
        self._rest, self._number, self._session = b"", 0, ""
        self.errors: list[str] = []
        self.requests: list[str] = []
        self.loaded = False
        target = self("Target.createTarget", url="about:blank")["targetId"]
        self._session = self("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self(f"{domain}.enable")

    def __call__(self, method: str, **params: Any) -> dict[str, Any]:
        """Send a command and return its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        self._to.write(json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                return answer["result"]

    def _next(self, seconds: float = 60.0) -> dict[str, Any]:
        end = time.monotonic() + seconds
        while b"\0" not in self._rest:
            assert time.monotonic() < end and self._process.poll() is None, "the browser does not answer"
            self._rest += os.read(self._from, 1 << 16)
        line, _, self._rest = self._rest.partition(b"\0")
        message = json.loads(line)
        self._note(message.get("method", ""), message.get("params", {}))
        return message

    def _note(self, method: str, said: dict[str, Any]) -> None:
        if method == "Runtime.exceptionThrown":
            details = said["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"])[:500])
        elif method == "Runtime.consoleAPICalled" and said["type"] in ("error", "assert"):
            self.errors.append(json.dumps(said["args"])[:500])
        elif method == "Log.entryAdded" and said["entry"]["level"] == "error":
            self.errors.append(f"{said['entry']['text']} {said['entry'].get('url', '')}")
        elif method == "Network.requestWillBeSent":
            self.requests.append(said["request"]["url"])
        elif method == "Page.loadEventFired":
            self.loaded = True

    def open(self, where: Path | str, width: int = 1280) -> None:
        """Open a file or an address and wait until it has loaded."""
        self.errors, self.requests, self.loaded = [], [], False
        self("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
        self("Page.navigate", url=where.as_uri() if isinstance(where, Path) else where)
        self.wait()

    def follow(self, expression: str) -> str:
        """Do what leads to another page, and return its address once it has loaded."""
        self.loaded = False
        self.ask(expression)
        self.wait()
        return str(self.ask("location.href"))

    def wait(self) -> None:
        """Wait until a page has loaded that was asked for."""
        while not self.loaded:
            self._next()
        self("Runtime.evaluate", expression="document.fonts.ready.then(() => 1)", awaitPromise=True)

    def ask(self, expression: str) -> Any:
        """Return the value of an expression."""
        return self("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)["result"].get(
            "value"
        )

    def press_tab(self) -> None:
        """Press the tabulator once."""
        for kind in ("rawKeyDown", "keyUp"):
            self("Input.dispatchKeyEvent", type=kind, key="Tab", code="Tab", windowsVirtualKeyCode=9)

    def close(self) -> None:
        """End the browser."""
        with contextlib.suppress(Exception):
            self._session = ""
            self("Browser.close")
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(10)
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        self._to.close()
        os.close(self._from)

    def faults(self, width: int) -> list[str]:
        """Return what is wrong with the open page: errors, requests elsewhere, overflow, pictures that are missing."""
        found = [f"error: {error}" for error in self.errors]
        found += [f"asks for {url}" for url in self.requests if not url.startswith(("file://", "data:", "blob:"))]
        if cut := self.ask(_CUT_OFF):
            found.append(f"cut off at {width} px: {cut}")
        if self.ask("document.documentElement.scrollWidth") > width:
            found.append(f"wider than the screen of {width} px: {self.ask(_WIDE)}")
        if broken := self.ask(_BROKEN):
            found.append(f"pictures that cannot be drawn: {broken}")
        return found

    def becomes(self, expression: str, seconds: float = 20.0) -> Any:
        """Return the value of an expression as soon as it counts as true, or after some seconds."""
        end = time.monotonic() + seconds
        while not (value := self.ask(expression)) and time.monotonic() < end:
            time.sleep(0.05)
        return value

    def picture(self, file: Path) -> None:
        """Write what the screen shows as PNG."""
        file.write_bytes(base64.b64decode(self("Page.captureScreenshot", format="png")["data"]))
