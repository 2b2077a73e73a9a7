# rpcbind.tcl -- a namespace of one's own, where programs of others find our instruments by an rpcbind of their own.

testConstraint lxi [expr {[auto_execok lxi] ne {}}]
testConstraint namespaces [expr {![catch {exec unshare --net ip link add cable type veth peer name plug}]}]
testConstraint ownRpcbind [file executable /usr/sbin/rpcbind]

# Run pieces of a shell script there. Nothing is left of it. The daemon has an object foo.a.
proc inNamespace args {
    set before {
        ip link set lo up
        mount --make-rprivate / 2> /dev/null    # in a root that is no mount of its own all is private
        mount -t tmpfs none /run
        mkdir -m 700 /run/rpcbind /run/sorma /run/said
        export SORMA_RUNTIME_DIR=/run/sorma
        gaveUp() { echo "gave up: $*"; "$@"; tail -n 50 /run/said/*; exit 9; }
        waitFor() { n=0; until "$@" > /dev/null 2>&1; do n=$((n + 1)); [ $n -lt 300 ] || gaveUp "$@"; sleep 0.1; done; }
        rpcbind() { /usr/sbin/rpcbind -f > /run/said/rpcbind 2>&1 & waitFor rpcinfo -p 127.0.0.1; }
        # Another network than that of this host alone: 10.77.0.1, with Avahi.
        avahi() {
            ip link add lan0 type veth peer name lan1
            ip link set lan0 up
            ip link set lan1 up
            ip addr add 10.77.0.1/24 dev lan0
            mkdir /run/dbus /run/avahi-daemon
            dbus-daemon --system --nofork --nopidfile > /run/said/dbus 2>&1 &
            waitFor test -S /run/dbus/system_bus_socket
            printf '[server]\nuse-ipv6=no\nallow-interfaces=lan0\n' > /run/said/avahi.conf
            avahi-daemon --no-drop-root --no-chroot --no-rlimits -f /run/said/avahi.conf > /run/said/avahi 2>&1 &
            waitFor avahi-browse -at
        }
        daemon() { rm -f /run/said/box; sormad -name box -make foo.a "$@" > /run/said/box 2> /run/said/box.errors & waitFor grep -q ready /run/said/box; }
    }
    return [exec unshare --net --mount --propagation unchanged --pid --fork --kill-child sh -c [join [list $before {*}$args] \n] 2>@1]
}
