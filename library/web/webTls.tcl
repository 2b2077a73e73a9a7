# webTls.tcl -- sorma-web for other hosts: HTTPS with the keys of SORMA (sorma-keys).
#
# It shows the certificate of this host, or another one of the folder, and is called by the names in it. Clients may show one of our own authority.

package require sorma::keyFolder
package provide sorma::webTls 1.0

namespace eval ::sorma::webTls {}

# ::sorma::webTls::keys NAME -- a dict: keys and authority as PEM, hosts: the names. NAME: in the folder; empty: the one of this host.
proc ::sorma::webTls::keys name {
    if {$name eq {}} {
        set name [::sorma::keyFolder::own]
    }
    set file [::sorma::keyFolder::path $name.pem]
    if {$name eq {} || $name ni [::sorma::keyFolder::names]} {
        return -code error -errorcode {SORMA TLS MISSING} [expr {$name eq {} ? "there is no certificate in [::sorma::keyFolder::folder]: sorma-keys new NAME, or sorma-keys take FILE" :
            "there is no $file: sorma-keys list shows which there are"}]
    }
    ::sorma::CheckKeys $name
    set pem [::sorma::keyFolder::text $file]
    set authority [::sorma::keyFolder::path authority.pem]
    return [dict create keys $pem authority [expr {[file exists $authority] ? [::sorma::keyFolder::text $authority] : {}}] \
        hosts [::sorma::keyFolder::hosts [lindex [::sorma::keyFolder::parts CERTIFICATE $pem] 0]]]
}

# ::sorma::webTls::here ADDRESS -- is it only reached from this host?
proc ::sorma::webTls::here address {
    return [expr {[regexp {^127\.\d+\.\d+\.\d+$} $address] || $address eq "::1"}]
}
