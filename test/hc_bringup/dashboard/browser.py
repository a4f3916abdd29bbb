"""A headless Chromium for the tests of the page, or the reason why there is none."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from typing import Any

WIDTH, HEIGHT = 1300, 1000


def why_not() -> str:
    """Return why the page cannot be tested here; empty if it can."""
    try:
        import selenium  # noqa: F401
    except ImportError:
        return "needs the package selenium"
    for program in ("chromium", "chromedriver"):
        if shutil.which(program) is None:
            return f"needs {program} (Debian: apt-get install chromium chromium-driver)"
    return ""


class Browser:
    """One window."""

    def __init__(self, width: int = WIDTH, height: int = HEIGHT, *, dark: bool = False) -> None:
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service

        options = webdriver.ChromeOptions()
        options.binary_location = str(shutil.which("chromium"))
        for argument in (
            "--headless=new",
            "--no-sandbox",  # containers have no user namespaces
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--force-device-scale-factor=1",
            "--js-flags=--expose-gc",
            "--enable-precise-memory-info",
        ):
            options.add_argument(argument)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(options, Service(shutil.which("chromedriver")))
        self.driver.set_script_timeout(30)
        self.resize(width, height)
        self.send(
            "Emulation.setEmulatedMedia",
            features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}],
        )

    def send(self, command: str, **arguments: Any) -> Any:
        """Send a command of the DevTools protocol."""
        return self.driver.execute_cdp_cmd(command, arguments)

    def resize(self, width: int, height: int) -> None:
        """Give the page another size."""
        self.send(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )

    def open(self, address: str) -> None:
        """Open a page."""
        self.driver.get(address)

    def run(self, script: str, *arguments: Any) -> Any:
        """Run a script in the page and return what it returns."""
        return self.driver.execute_script(script, *arguments)

    def text(self, selector: str) -> str:
        """Return the text of an element."""
        return str(self.run("return document.querySelector(arguments[0]).textContent", selector))

    def wait(self, condition: Callable[[], Any], what: str, timeout_s: float = 15.0) -> Any:
        """Wait until something holds; returns it."""
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            value = condition()
            if value:
                return value
            time.sleep(0.05)
        raise AssertionError(f"not within {timeout_s} s: {what}; the page says {self.words()}")

    def wait_for(self, script: str, timeout_s: float = 15.0) -> Any:
        """Wait until an expression of the page is true; returns it."""
        return self.wait(lambda: self.run(f"return {script}"), script, timeout_s)

    def press(self, key: str) -> None:
        """Press a key."""
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.driver).send_keys(key).perform()

    def words(self) -> dict[str, str]:
        """Return what the page says of its state."""
        script = "return document.getElementById(arguments[0])?.textContent ?? ''"
        return {name: str(self.run(script, name)) for name in ("state", "banner", "message")}

    def complaints(self) -> list[str]:
        """Return errors of scripts, policies and missing files since the last call."""
        return [
            entry["message"]
            for entry in self.driver.get_log("browser")
            if entry["level"] in ("SEVERE", "WARNING")
        ]

    def close(self) -> None:
        """End the browser."""
        self.driver.quit()
