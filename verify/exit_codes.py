"""What the command's exit codes mean; with several scenarios the worst, which is the greatest, wins."""

OK = 0  # every scenario ran, every gate passed
FAILED = 1  # every scenario ran; a gate or check failed, or the verdict is `failed`
BAD_INPUT = 2  # nothing was run for that scenario, or the folder to check is no result
UNFINISHED = 3  # something could not finish
INTERRUPTED = 130  # the shell's code for Ctrl-C
