"""The parameters of one run as they are settled: their values, origins, models and relations."""
