"""A report in the formats of other programs: SARIF and annotations for code review, JUnit for test results."""
