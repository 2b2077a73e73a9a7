/* ring.pml -- how the two ends of generic/comm/ring.h put each other to sleep and wake each other, for the model checker spin.
 *
 * Each end writes N bytes to the other one and reads N from it, by rings of SIZE bytes. Every access to shared memory is a step of its
 * own, and steps of both ends mix in any order. All those in ring.h that the argument rests on are sequentially consistent. A bell is a
 * byte on the socket: an end takes all bells at once, then looks at both of its rings. A reader that waits for nothing else may doze
 * instead: the kernel lets it sleep while its mark says so, and whoever takes the mark away wakes it (futex).
 *
 * spin finds out that nobody sleeps for ever (no end state but that of both programs), that bytes come once and in order, and that counts
 * make sense. -DHASTY leaves out the second look before a sleep, of the reader; -DDEAF that of the writer; with -DLATE a reader wakes no
 * writer. All three must be found.
 */
#ifndef SIZE
#define SIZE 3
#endif
#ifndef N
#define N 4
#endif

#define LOW (SIZE / 2)          /* so many bytes are left when a writer is woken */
#ifdef LATE
#undef LOW
#define LOW (-1)
#endif

#define AWAKE 0
#define SLEEPS 1
#define DOZES 2

typedef Ring {
    byte written;           /* counts since the beginning; each has one writer */
    byte taken;
    byte reader;            /* AWAKE, SLEEPS or DOZES */
    bit writer;             /* it waits for room */
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
    :: mark != AWAKE -> atomic { was = mark; mark = AWAKE }
        if
        :: was == SLEEPS -> ring(to)
        :: else
        fi
    :: else
    fi
}

proctype End(byte me) {
    byte other = 1 - me;
    byte written = 0, seenTaken = 0;    /* as a writer to the other end */
    byte taken = 0, here;               /* as a reader */
    byte was;
    bit idle, noRoom, dozes;

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
                wake(rings[other].reader, other);
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
            if
            :: here - 1 <= LOW -> wake(rings[me].writer, other)
            :: else
            fi;
            idle = 0
        :: else
        fi;
        /* sleep */
        if
        :: idle ->
            if
            :: noRoom ->
                rings[other].writer = 1;
#ifndef DEAF
                seenTaken = rings[other].taken;
                if
                :: written - seenTaken < SIZE -> rings[other].writer = 0; idle = 0
                :: else
                fi
#endif
            :: else ->                  /* pages could be given back when the other one has taken more */
                if
                :: written != seenTaken -> rings[other].writer = 1
                :: true
                fi
            fi;
            if
            :: idle ->
                if
                :: !noRoom -> dozes = 1
                :: dozes = 0
                fi;
                rings[me].reader = (dozes -> DOZES : SLEEPS);
#ifndef HASTY
                if
                :: rings[me].written != taken -> rings[me].reader = AWAKE; idle = 0
                :: else
                fi
#endif
            :: else
            fi;
            if
            :: idle && dozes ->
                rings[me].reader != DOZES       /* blocks */
            :: idle && !dozes ->
                bells[me] > 0;          /* blocks */
                bells[me] = 0;
                rings[me].reader = AWAKE
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
