#include "bus/incident.h"

#include "bus/service.h"

namespace sorma {

HasIncidents::~HasIncidents() = default;

void tellIncidents(const Service& service, Incidents& out) {
    if (auto* has = dynamic_cast<const HasIncidents*>(&service)) has->tellIncidents(out);
}

}  // namespace sorma
