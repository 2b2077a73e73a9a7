/* ring.pml -- how the two ends of generic/comm/ring.h put each other to sleep and wake each other, for the model checker spin.
 *
 * Each end writes N bytes to the other one and reads N from it, by rings of SIZE bytes. Every access to shared memory is a step of its
 * own, and steps of both ends mix in any order. All those in ring.h that the argument rests on are sequentially consistent. A bell is a
 * byte on the socket: an end takes all bells at once, then looks at both of its rings.
 *
 * spin finds out that nobody sleeps for ever (no end state but that of both programs), that bytes come once and in order, and that counts
 * make sense. -DHASTY leaves out the second look before a sleep, of the reader; -DDEAF that of the writer: both must be found.
 */
#ifndef SIZE
#define SIZE 2
#endif
#ifndef N
#define N 4
#endif

typedef Ring {
    byte written;           /* counts since the beginning; each has one writer */
    byte taken;
    bit readerSleeps;
    bit writerWaits;
    byte bytes[SIZE]
};
Ring rings[2];              /* rings[i] leads to end i */
byte bells[2];              /* on the socket, for end i; more than one say no more than one */

inline ring(to) {
    bells[to] = 1
}
/* The end that wakes the other one takes its mark away. */
inline wake(mark, to) {
    if
    :: mark -> atomic { was = mark; mark = 0 }
        if
        :: was -> ring(to)
        :: else
        fi
    :: else
    fi
}

proctype End(byte me) {
    byte other = 1 - me;
    byte written = 0, seenTaken = 0;    /* as a writer to the other end */
    byte taken = 0, here;               /* as a reader */
    bit was, idle, noRoom;

    do
    :: written == N && taken == N -> break
    :: else ->
        idle = 1;
        noRoom = 0;
        /* write */
        if
        :: written < N ->
            if
            :: written - seenTaken == SIZE -> seenTaken = rings[other].taken; assert(written - seenTaken <= SIZE)
            :: else
            fi;
            if
            :: written - seenTaken < SIZE ->
                rings[other].bytes[written % SIZE] = written;
                written++;
                rings[other].written = written;
                wake(rings[other].readerSleeps, other);
                idle = 0
            :: else ->
                noRoom = 1
            fi
        :: else
        fi;
        /* read */
        here = rings[me].written - taken;
        assert(here <= SIZE);
        if
        :: here > 0 ->
            assert(rings[me].bytes[taken % SIZE] == taken);
            taken++;
            rings[me].taken = taken;
            wake(rings[me].writerWaits, other);
            idle = 0
        :: else
        fi;
        /* sleep */
        if
        :: idle ->
            if
            :: noRoom ->
                rings[other].writerWaits = 1;
#ifndef DEAF
                seenTaken = rings[other].taken;
                if
                :: written - seenTaken < SIZE -> rings[other].writerWaits = 0; idle = 0
                :: else
                fi
#endif
            :: else ->                  /* pages could be given back when the other one has taken more */
                if
                :: written != seenTaken -> rings[other].writerWaits = 1
                :: true
                fi
            fi;
            if
            :: idle ->
                rings[me].readerSleeps = 1;
#ifndef HASTY
                if
                :: rings[me].written != taken -> rings[me].readerSleeps = 0; idle = 0
                :: else
                fi
#endif
            :: else
            fi;
            if
            :: idle ->
                bells[me] > 0;          /* blocks */
                bells[me] = 0;
                rings[me].readerSleeps = 0
            :: else
            fi
        :: else
        fi
    od
}

init {
    atomic {
        run End(0);
        run End(1)
    }
}
