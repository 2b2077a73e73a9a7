#compdef scott
# scott.zsh -- completion of scott's command line in zsh, as file _scott in its function path. What there is scott says itself:
# commands, and the objects of all daemons.

local -a found
found=(${(f)"$(${words[1]} --complete ${(@)words[2,CURRENT]} 2>/dev/null)"})
(( ${#found} )) && compadd -a found || _files
