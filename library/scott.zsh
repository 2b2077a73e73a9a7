#compdef scott scottwish sorma-browser sorma-keys sorma-neo sorma-record sorma-replay sorma-web
# scott.zsh -- completion of the command lines of scott, scottwish, sorma-browser, sorma-keys, sorma-neo, sorma-record, sorma-replay and sorma-web in zsh, as file _scott in its function path.
# What there is they say themselves: commands, and what is at all daemons.

# The word at the cursor as far as it goes, perhaps an empty one; all of them as scott would get them, without their quotes.
local -a found
found=(${(f)"$("${words[1]}" --complete "${(@Q)words[2,CURRENT-1]}" "${(Q)PREFIX}" 2>/dev/null)"})
(( ${#found} )) && compadd -a found || _files
