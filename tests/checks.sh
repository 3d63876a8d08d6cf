# Functions of the tests of packages, which source this file: they count checks.

passed=0 failed=0 notes=()

# check NAME COMMAND...: counts a command that must succeed, and shows its output if it does not
check() {
    if "${@:2}" >check.log 2>&1; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
        printf 'FAILED %s\n' "$1"
        cat check.log
    fi
}
# no COMMAND...: succeeds if the command fails
no() { ! "$@"; }
# says PATTERN COMMAND...: succeeds if the command does, and prints a line that matches
says() { "${@:2}" >said && cat said && grep -Eq -- "$1" said; }
# holds FILE...: succeeds if no file is missing or empty
holds() {
    local file
    for file; do [ -s "$file" ] || { echo "$file: missing or empty" && return 1; }; done
}
# first_picture NAME START: notes the time since START
first_picture() { notes+=("$(printf '%-8s %3d s from the download to the first picture' "$1" $((SECONDS - $2)))"); }
# report: prints the notes and the counts; succeeds if no check has failed
report() {
    [ ${#notes[@]} -eq 0 ] || printf '%s\n' "${notes[@]}"
    printf '%d passed, %d failed\n' "$passed" "$failed"
    [ "$failed" -eq 0 ]
}
