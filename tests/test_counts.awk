# Sums the results of cargo test, of Python's unittest and of the hard cases in a log; prints "PASSED FAILED SKIPPED".

# test result: FAILED. 12 passed; 1 failed; 0 ignored; 0 measured; 3 filtered out; finished in 0.12s
/^test result: / {
    for (i = 2; i <= NF; i++) {
        if ($i == "passed;") passed += $(i - 1)
        if ($i == "failed;") failed += $(i - 1)
        if ($i == "ignored;") skipped += $(i - 1)
    }
}

# test furnaces::box ... ignored, long
# Tests of the long form are left out on purpose.
/^test .* \.\.\. ignored, long/ { skipped-- }

# 243 met, 18 known to fail, 1 failed, 377 s. A case that fails as it is known to has said what it is to say.
/^[0-9]+ met, [0-9]+ known to fail, [0-9]+ failed, / {
    passed += $1 + $3
    failed += $7
}

# Ran 14 tests in 2.103s
/^Ran [0-9]+ tests? in / { ran = $2 }

# FAILED (failures=1, errors=2, skipped=3, expected failures=4, unexpected successes=5): "Ran" counts all of these, but
# not the errors of class and module fixtures nor second failures within a test, so it may be the smaller number.
ran != "" && /^(OK|FAILED|NO TESTS RAN)/ {
    bad = out = 0
    n = split($0, parts, /[(),] */)
    for (i = 1; i <= n; i++) {
        split(parts[i], pair, "=")
        if (pair[1] == "failures" || pair[1] == "errors" || pair[1] == "unexpected successes") bad += pair[2]
        if (pair[1] == "skipped") out += pair[2]
    }
    good = ran - bad - out
    if (good > 0) passed += good
    failed += bad
    skipped += out
    ran = ""
}

END { print passed + 0, failed + 0, skipped + 0 }
