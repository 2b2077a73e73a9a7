"""wireClient.py ADDRESS: sorma.py, as wireCheck.py wants a client."""
import sys

import sorma

daemon = sorma.connect(sys.argv[1], timeout=20)
for i in range(5):
    try:
        daemon["echo"].exec(ints=[i])
        print("answered", flush=True)
    except sorma.Error as e:
        print(e.verdict, flush=True)
