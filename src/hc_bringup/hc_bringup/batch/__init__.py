"""hc batch: thousands of recordings through the estimator, on one machine or on many.

sources finds the recordings, variants the ways to estimate, work does one recording and keeps its
result in a file, engines share the work among processes, tables and hc_bringup.report.batch_page
gather the results, campaign holds it all together.
"""
