// level.h -- levels of play, from child to full strength.
#pragma once

#include "draughts/search.h"

namespace draughts {

// Number of positions that it looks at, and the error of their values in hundredths of a man.
struct Level {
    std::uint64_t nodes;    // 0: as the time allows
    int noise;
    const char* help;
};
inline constexpr Level kLevels[] = {
    {30, 200, "a child"},       {80, 120, "a beginner"},      {200, 70, ""},         {500, 40, "plays now and then"},
    {1500, 20, ""},             {4000, 8, "a club player"},   {12000, 0, ""},        {40000, 0, "a strong amateur"},
    {150000, 0, "a master"},    {0, 0, "full strength"},
};
inline constexpr int kFullLevel = 10;
inline constexpr int kOpeningPlies = 8;     // in these a seed other than 0 brings variety

// The settings and limits of a move at a level; limits that are set already stay when they are lower.
inline void atLevel(int level, std::uint64_t seed, std::size_t plies, Limits& limits, SearchSettings& settings) {
    const Level& l = kLevels[level - 1];
    if (l.nodes && (!limits.nodes || l.nodes < limits.nodes)) limits.nodes = l.nodes;
    settings.noise = l.noise;
    settings.seed = seed * 1000003 + plies;
    if (seed && plies < std::size_t(kOpeningPlies) && settings.noise < 15) settings.noise = 15;
}

}  // namespace draughts
