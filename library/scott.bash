# scott.bash -- completion of the command lines of scott, scottwish, sorma-browser, sorma-keys, sorma-neo, sorma-record, sorma-replay and sorma-web in bash. What there is they say themselves:
# commands, and what is at all daemons.

_scott() {
    local current="${COMP_WORDS[COMP_CWORD]}" line="${COMP_LINE:0:COMP_POINT}" words word
    # By blanks: bash also breaks words at @ and :, of which names are made.
    read -ra words <<< "$line"
    [[ "$line" == *[[:space:]] ]] && words+=("")
    word="${words[${#words[@]}-1]}"
    local IFS=$'\n'
    COMPREPLY=($("${words[0]}" --complete "${words[@]:1}" 2>/dev/null))
    # Bash replaces what stands behind the last of its breaks.
    local before="${word%"$current"}"
    COMPREPLY=("${COMPREPLY[@]#"$before"}")
}
complete -o bashdefault -o default -F _scott scott scottwish sorma-browser sorma-keys sorma-neo sorma-record sorma-replay sorma-web
