"""The whole application, to which faults are done from outside: `python -m bench.faults.whole FOLDER`.

Lines of JSON come in, the orders of `bench.faults.running`, and go out: what the operator sees. Every process that the
application starts begins by importing this module again, so that each plans and calibrates by what stands in.
"""

import sys

from bench.faults.standin import stand_in

if __name__ in ("__main__", "__mp_main__"):
    stand_in()

if __name__ == "__main__":
    from bench.faults.running import main

    sys.exit(main(sys.argv[1:]))
