"""Changes of signals that no controller was told of, because they came faster than they are read, in a whole run.

A driver counts from its own beginning what its image has coalesced, and a host gets another driver after an emergency
stop. A promise keeps a signal in the image as it was: one that changes meanwhile and changes back has done so unseen,
too, and that its host sees. What a run has coalesced is all of this together, whether anybody asks for figures or not.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from firable.executor.drivers.driver import Driver


class Coalesced:
    """What was coalesced in a run that begins with this driver."""

    def __init__(self, driver: Driver) -> None:
        self.driver = driver
        self.of_drivers_before: Counter[str] = Counter()
        self.behind_promises: Counter[str] = Counter()

    def up_to_now(self, driver: Driver) -> Counter[str]:
        """For each signal how many of its changes, at least one, were told to nobody; `driver` is the present one."""
        if driver is not self.driver:
            self.of_drivers_before += _of(self.driver)
            self.driver = driver
        return self.of_drivers_before + self.behind_promises + _of(driver)


def _of(driver: Driver) -> Counter[str]:
    return Counter({signal: reading.coalesced for signal, reading in driver.readings().items()})
