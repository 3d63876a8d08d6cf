# The seconds and the name of each test in a log of cargo test or of tests/python/timed.py.

# test furnaces::box ... ok <1.234s>
/^test .* <[0-9.]+s>$/ { printf "%.1f %s\n", substr($NF, 2), $2 }

# test_export.Export.test_glass: 1.2 s
/^[a-z0-9_.]+\.[A-Za-z0-9_.]+: [0-9.]+ s$/ { printf "%.1f %s\n", $2, substr($1, 1, length($1) - 1) }
