// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace pounce::cli {

/// Text as it may reach a terminal. Names in files and names of files may hold what a terminal
/// obeys: control characters and marks that turn the direction of writing become "\u001b" and the
/// like, which is also what JSON calls them, and bytes that are no UTF-8 become "\x9b". Line ends
/// and tabs stay, since they are ours; everything else is as it was.
std::string visible(std::string_view text);
/// The same for a message, which is one line whatever the names in it hold.
std::string visible_line(std::string_view text);

}  // namespace pounce::cli
