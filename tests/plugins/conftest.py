"""Nothing that a test registers stays."""

from tests.plugins.cases import nothing_stays_registered as nothing_stays_registered
