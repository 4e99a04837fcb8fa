"""A report as one HTML page: `page.page` makes it of a `batch.report.contents.parts.Report`."""
