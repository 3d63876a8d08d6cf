#!/usr/bin/env bash
# As RUSTC_WRAPPER, compiles test programs with little optimisation, in half of the time. The libraries and programs that
# they test are compiled as they are released.
case " $* " in
*' --test '*) exec "$@" -C opt-level=1 ;;
esac
exec "$@"
